/* Moments of cells of pixels, polynomials of least squares in windows of cells, and their values between cells.

   The operations of regression.py and reconstruction.py in their order, so that the results have the same bits.
   compiled_fits.py calls this file by ctypes, without the interpreter lock. */

#include "polynomials.h"

enum { INTERFACE = 2 }; /* of compiled_fits.py: both change together */
/* Rows of a fit: coefficients, value and leverage at the cell itself, sum of squared residuals, count. */
enum { VALUE = COEFFICIENTS, LEVERAGE, RESIDUAL, PIXELS, FIT };
enum { PLACES = 4 }; /* pixels of a cell */

/* Planes of float64, whose columns are adjacent. */
typedef struct {
  double *data;
  int64_t plane, row; /* from one to the next [values] */
} Planes;

INLINE double *at(const Planes *of, int64_t plane, int64_t row, int64_t column) {
  return of->data + plane * of->plane + row * of->row + column;
}

INLINE void store(const Planes *out, int64_t plane, int64_t row, int64_t column, int64_t count, const double *values) {
  double *place = at(out, plane, row, column);
  for (int64_t k = 0; k < count; k++)
    place[k] = values[k];
}

/* Sums over the pixels of cells. */
INLINE void sum(Lanes a[PLACES], double *out) {
  EACH_LANE out[k] = (a[0][k] + a[1][k]) + (a[2][k] + a[3][k]);
}

INLINE void sum_products(Lanes a[PLACES], Lanes b[PLACES], double *out) {
  EACH_LANE out[k] = (a[0][k] * b[0][k] + a[1][k] * b[1][k]) + (a[2][k] * b[2][k] + a[3][k] * b[3][k]);
}

/* The moments of cells of 2 x 2 pixels: share, hidden share and features of each, (8, 4, rows, columns). */
EXPORT void illum_cell_moments(const float *pixels, int64_t rows, int64_t columns, const Planes *out) {
  for (int64_t row = 0; row < rows; row++)
    for (int64_t column = 0; column < columns; column += LANES) {
      Lanes values[2 + FEATURES][PLACES] = {{{0}}}, weighted[PLACES], own[PLACES], sums[MOMENTS];
      int64_t count = smaller(LANES, columns - column);
      for (int plane = 0; plane < 2 + FEATURES; plane++)
        for (int place = 0; place < PLACES; place++) {
          const float *from = pixels + ((plane * PLACES + place) * rows + row) * columns + column;
          for (int64_t k = 0; k < count; k++)
            values[plane][place][k] = from[k];
        }
      Lanes *share = values[0], *hidden = values[1], (*features)[PLACES] = values + 2;
      for (int place = 0; place < PLACES; place++)
        EACH_LANE weighted[place][k] = share[place][k] * hidden[place][k];
      sum(share, sums[COUNT]);
      sum(weighted, sums[HIDDEN]);
      sum_products(weighted, hidden, sums[SQUARE]);
      for (int i = 0, pair = PAIR; i < FEATURES; i++) {
        for (int place = 0; place < PLACES; place++)
          EACH_LANE own[place][k] = share[place][k] * features[i][place][k];
        sum(own, sums[FEATURE + i]);
        sum_products(weighted, features[i], sums[HIDDEN_FEATURE + i]);
        for (int j = 0; j <= i; j++)
          sum_products(own, features[j], sums[pair++]);
      }
      for (int plane = 0; plane < MOMENTS; plane++)
        store(out, plane, row, column, count, sums[plane]);
    }
}

/* Sums over 2 x 2 cells. */
EXPORT void illum_sum_cells(const Planes *cells, int64_t rows, int64_t columns, const Planes *out) {
  for (int plane = 0; plane < MOMENTS; plane++)
    for (int64_t row = 0; row < rows; row++) {
      const double *upper = at(cells, plane, 2 * row, 0), *lower = at(cells, plane, 2 * row + 1, 0);
      double *sums = at(out, plane, row, 0);
      for (int64_t k = 0; k < columns; k++)
        sums[k] = (upper[2 * k] + lower[2 * k]) + (upper[2 * k + 1] + lower[2 * k + 1]);
    }
}

/* Sums over windows around cells: down the rows, then across. */
INLINE void sum_windows(const Planes *of, int64_t radius, int64_t row, int64_t column, int64_t count, Lanes *sums) {
  int64_t size = 2 * radius + 1, width = count + 2 * radius;
  for (int plane = 0; plane < MOMENTS; plane++) {
    double down[LANES + 2 * LANES], *out = sums[plane];
    const double *from = at(of, plane, row - radius, column - radius);
    for (int64_t k = 0; k < width; k++)
      down[k] = from[k] + from[of->row + k];
    for (int64_t y = 2; y < size; y++)
      for (int64_t k = 0; k < width; k++)
        down[k] += from[y * of->row + k];
    for (int64_t k = 0; k < count; k++)
      out[k] = down[k] + down[k + 1];
    for (int64_t x = 2; x < size; x++)
      for (int64_t k = 0; k < count; k++)
        out[k] += down[k + x];
  }
}

/* Fits in windows around the cells of an area, (11, rows, columns); `cells` reaches a radius beyond it on all sides. */
EXPORT void illum_window_fits(const Planes *cells, int64_t radius, int64_t rows, int64_t columns, const Planes *out) {
  for (int64_t row = 0; row < rows; row++)
    for (int64_t column = 0; column < columns; column += LANES) {
      Lanes sums[MOMENTS] = {{0}}, own[FEATURES] = {{0}}, fit[FIT] = {{0}}, is_solved = {0};
      int64_t count = smaller(LANES, columns - column), solved = 0;
      sum_windows(cells, radius, row, column, count, sums);
      EACH_LANE fit[PIXELS][k] = sums[COUNT][k];
      const double *held = at(cells, COUNT, row, column);
      for (int64_t k = 0; k < count; k++)
        solved += is_solved[k] = held[k] > 0 && sums[HIDDEN][k] > 0;
      if (solved) {
        for (int i = 0; i < FEATURES; i++)
          for (int64_t k = 0; k < count; k++)
            own[i][k] = *at(cells, FEATURE + i, row, column + k) / greater(held[k], LEAST_COUNT);
        Polynomials polynomials;
        solve(sums, &polynomials);
        coefficients(&polynomials, fit);
        evaluate(&polynomials, own, fit[VALUE], fit[LEVERAGE]);
        EACH_LANE {
          double hidden = sums[HIDDEN][k], square = sums[SQUARE][k] - hidden * hidden - polynomials.explained[k];
          fit[RESIDUAL][k] = greater(square, 0) * polynomials.total[k];
        }
      }
      for (int64_t k = 0; k < count; k++) /* Nothing in the window is hidden, or the cell is empty. */
        if (!is_solved[k]) {
          for (int plane = 0; plane < PIXELS; plane++)
            fit[plane][k] = 0;
          fit[LEVERAGE][k] = 1 / greater(fit[PIXELS][k], 1);
        }
      for (int plane = 0; plane < FIT; plane++)
        store(out, plane, row, column, count, fit[plane]);
    }
}

/* Bilinear means of cells for their four pixels or finer cells, a quarter of a cell from the centre. The last plane is
   the weight of the cells, which the others were multiplied by; cells outside hold nothing. */
typedef struct {
  Planes planes;
  int64_t number, rows, columns;
} Weighted;

INLINE double mean(double near, const double *far) { return far ? 0.75 * near + 0.25 * *far : 0.75 * near; }

/* One plane of a row, from column `first` on, in the upper or lower half of the cells: the left and right means. */
INLINE void halves(const Weighted *of, int64_t plane, int64_t row, int is_lower, int64_t first, int64_t count,
                   double *left, double *right) {
  double room[LANES + 2], *down = room + 1;
  int64_t other = is_lower ? row + 1 : row - 1, start = first > 0 ? -1 : 0;
  int64_t end = first + count < of->columns ? count + 1 : count;
  const double *near = at(&of->planes, plane, row, first);
  const double *far = other >= 0 && other < of->rows ? at(&of->planes, plane, other, first) : 0;
  for (int64_t k = start; k < end; k++)
    down[k] = mean(near[k], far ? far + k : 0);
  for (int64_t k = 0; k < count; k++) {
    left[k] = mean(down[k], k > start ? down + k - 1 : 0);
    right[k] = mean(down[k], k + 1 < end ? down + k + 1 : 0);
  }
}

/* The means over the weights, at twice the rows and columns. */
EXPORT void illum_finer(const Weighted *of, const Planes *out) {
  for (int64_t row = 0; row < 2 * of->rows; row++)
    for (int64_t first = 0; first < of->columns; first += LANES) {
      Lanes weight[2], value[2];
      int64_t count = smaller(LANES, of->columns - first);
      halves(of, of->number - 1, row / 2, row % 2, first, count, weight[0], weight[1]);
      for (int64_t plane = 0; plane < of->number - 1; plane++) {
        double *place = at(out, plane, row, 2 * first);
        halves(of, plane, row / 2, row % 2, first, count, value[0], value[1]);
        for (int64_t k = 0; k < count; k++)
          for (int side = 0; side < 2; side++)
            place[2 * k + side] = value[side][k] / greater(weight[side][k], LEAST_COUNT);
      }
    }
}

/* The values of polynomials at the features of pixels, (6, 4, rows, columns), into planes of each place in a cell. */
EXPORT void illum_interpolated(const Weighted *of, const float *features, const Planes *out) {
  for (int64_t row = 0; row < of->rows; row++)
    for (int place = 0; place < PLACES; place += 2)
      for (int64_t first = 0; first < of->columns; first += LANES) {
        Lanes value[2], slope[2];
        int64_t count = smaller(LANES, of->columns - first);
        halves(of, CONSTANT, row, place / 2, first, count, value[0], value[1]);
        for (int i = 0; i <= FEATURES; i++) {
          halves(of, SLOPE + i, row, place / 2, first, count, slope[0], slope[1]);
          for (int side = 0; side < 2; side++) {
            const float *feature = features + ((i * PLACES + place + side) * of->rows + row) * of->columns + first;
            double *sum = value[side], *factor = slope[side];
            if (i < FEATURES)
              for (int64_t k = 0; k < count; k++)
                sum[k] += factor[k] * feature[k];
            else
              for (int64_t k = 0; k < count; k++)
                sum[k] /= greater(factor[k], LEAST_COUNT); /* the last plane: the weight */
          }
        }
        for (int side = 0; side < 2; side++)
          store(out, place + side, row, first, count, value[side]);
      }
}

EXPORT int illum_interface(void) { return INTERFACE; }
