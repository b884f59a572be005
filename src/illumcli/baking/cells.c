/* Cells of points: the nearest of each, moments, and fits in windows of the nearest.

   The operations of cells.py and reconstruction.py in their order, so that the results have the same bits.
   compiled_cells.py calls this file by ctypes, without the interpreter lock. */

#include "../visibility/polynomials.h"

enum { INTERFACE = 1 }; /* of compiled_cells.py: both change together */
enum { MOST_WINDOWS = 8, MOST_NEAREST = 64 };

/* Some of the cells of M points: `size` points each, of which the last ones may not be there. */
typedef struct {
  const double *features, *hidden; /* (6, M), (M,) */
  const int64_t *points;           /* (C, size) */
  const uint8_t *filled;           /* (C, size) */
  int64_t plane, size, cells;      /* M, size, C */
} Points;

/* Features and hidden share of a point of each of `count` cells, and 1 where there is one, else 0. */
INLINE void gather(const Points *of, int64_t cell, int64_t point, int64_t count, Lanes *features, double *hidden,
                   double *share) {
  for (int64_t k = 0; k < count; k++) {
    int64_t place = (cell + k) * of->size + point, index = of->points[place];
    for (int i = 0; i < FEATURES; i++)
      features[i][k] = of->features[i * of->plane + index];
    hidden[k] = of->hidden[index];
    share[k] = of->filled[place];
  }
}

/* The moments of each cell, (C, 36). */
EXPORT void illum_point_moments(const Points *of, double *out) {
  for (int64_t cell = 0; cell < of->cells; cell += LANES) {
    int64_t count = smaller(LANES, of->cells - cell);
    Lanes sums[MOMENTS] = {{0}}, features[FEATURES] = {{0}}, hidden = {0}, share = {0}, weighted, own;
    for (int64_t point = 0; point < of->size; point++) {
      gather(of, cell, point, count, features, hidden, share);
      EACH_LANE {
        weighted[k] = share[k] * hidden[k];
        sums[COUNT][k] += share[k];
        sums[HIDDEN][k] += weighted[k];
        sums[SQUARE][k] += weighted[k] * hidden[k];
      }
      for (int i = 0, pair = PAIR; i < FEATURES; i++) {
        EACH_LANE own[k] = share[k] * features[i][k];
        EACH_LANE sums[FEATURE + i][k] += own[k];
        EACH_LANE sums[HIDDEN_FEATURE + i][k] += weighted[k] * features[i][k];
        for (int j = 0; j <= i; j++, pair++)
          EACH_LANE sums[pair][k] += own[k] * features[j][k];
      }
    }
    for (int64_t k = 0; k < count; k++)
      for (int plane = 0; plane < MOMENTS; plane++)
        out[(cell + k) * MOMENTS + plane] = sums[plane][k];
  }
}

/* Windows of the nearest cells, and the fits in them. */
typedef struct {
  const double *moments;       /* of all cells, (cells, 36) */
  const int64_t *near;         /* (C, neighbours) */
  int64_t neighbours, windows; /* in a row of `near`; of each cell */
  int64_t sizes[MOST_WINDOWS]; /* of the windows [cells], ascending */
  double *coefficients;        /* (windows, 7, C) */
  double *residual, *leverage; /* (windows, C) */
  double *steps;               /* (C,) sum of squared differences of consecutive residuals, of the first window */
} Windows;

/* Fits in the windows of each cell: polynomials, and sums over its points of squared residuals and leverages. */
EXPORT void illum_point_fits(const Points *of, const Windows *windows) {
  for (int64_t cell = 0; cell < of->cells; cell += LANES) {
    int64_t count = smaller(LANES, of->cells - cell), nearer = 0;
    double total[LANES][MOMENTS] = {{0}}, by_rank[LANES][MOMENTS] = {{0}};
    for (int64_t window = 0; window < windows->windows; window++) {
      /* Sums over its cells, the nearer ones with more weight. */
      int64_t size = windows->sizes[window];
      Lanes sums[MOMENTS] = {{0}};
      for (int64_t k = 0; k < count; k++) {
        for (int64_t rank = nearer; rank < size; rank++) {
          const double *row = windows->moments + windows->near[(cell + k) * windows->neighbours + rank] * MOMENTS;
          for (int plane = 0; plane < MOMENTS; plane++) {
            total[k][plane] += row[plane];
            by_rank[k][plane] += (double)rank * row[plane];
          }
        }
        for (int plane = 0; plane < MOMENTS; plane++)
          sums[plane][k] = total[k][plane] - by_rank[k][plane] / (double)size;
      }
      nearer = size;

      /* The fit, and how far it is off at the cell's points. */
      Polynomials polynomials;
      Lanes fit[COEFFICIENTS], features[FEATURES] = {{0}}, hidden = {0}, share = {0}, off, own;
      Lanes residual = {0}, leverage = {0}, steps = {0}, last = {0}, last_share = {0};
      solve(sums, &polynomials);
      coefficients(&polynomials, fit);
      for (int64_t point = 0; point < of->size; point++) {
        gather(of, cell, point, count, features, hidden, share);
        evaluate(&polynomials, features, off, own);
        EACH_LANE {
          off[k] -= hidden[k];
          residual[k] += share[k] * (off[k] * off[k]);
          leverage[k] += share[k] * (own[k] < 1 ? own[k] : 1);
          double step = off[k] - last[k];
          steps[k] += share[k] * last_share[k] * (step * step);
          last[k] = off[k];
          last_share[k] = share[k];
        }
      }
      for (int64_t k = 0; k < count; k++) {
        for (int plane = 0; plane < COEFFICIENTS; plane++)
          windows->coefficients[(window * COEFFICIENTS + plane) * of->cells + cell + k] = fit[plane][k];
        windows->residual[window * of->cells + cell + k] = residual[k];
        windows->leverage[window * of->cells + cell + k] = leverage[k];
        if (window == 0)
          windows->steps[cell + k] = steps[k];
      }
    }
  }
}

/* Cells among which the nearest are searched. */
typedef struct {
  const float *centre, *normal; /* (4, cells), (3, cells) */
  const int64_t *near;          /* (groups, groups_near) groups in which those of a group are searched; -1 for none */
  int64_t cells, group, groups_near, wanted;
  float agree, apart; /* least cosine of normals, largest squared distance */
} Search;

/* The nearest cells of those of the groups from `first` to `end`, (cells, wanted), itself first; `cells` for none.
   Of cells at equal distances, the one that is searched first. */
EXPORT void illum_nearest_cells(const Search *of, int64_t first, int64_t end, int64_t *out) {
  for (int64_t own = first * of->group; own < smaller(end * of->group, of->cells); own++) {
    const int64_t *near = of->near + own / of->group * of->groups_near;
    float least[MOST_NEAREST];
    int64_t *nearest = out + own * of->wanted, found = 1;
    least[0] = -1;
    nearest[0] = own;
    for (int64_t slot = 0; slot < of->groups_near; slot++) {
      if (near[slot] < 0)
        continue;
      int64_t begin = near[slot] * of->group, stop = smaller(begin + of->group, of->cells);
      for (int64_t other = begin; other < stop; other++) {
        float square = 0, cosine = 0;
        for (int axis = 0; axis < 4; axis++) {
          float gap = of->centre[axis * of->cells + own] - of->centre[axis * of->cells + other];
          square += gap * gap;
        }
        if (found == of->wanted && !(square < least[found - 1]))
          continue;
        for (int axis = 0; axis < 3; axis++)
          cosine += of->normal[axis * of->cells + own] * of->normal[axis * of->cells + other];
        if (other == own || cosine < of->agree || square > of->apart)
          continue;
        int64_t place = found < of->wanted ? found++ : found - 1;
        for (; square < least[place - 1]; place--) {
          least[place] = least[place - 1];
          nearest[place] = nearest[place - 1];
        }
        least[place] = square;
        nearest[place] = other;
      }
    }
    for (; found < of->wanted; found++)
      nearest[found] = of->cells;
  }
}

EXPORT int illum_interface(void) { return INTERFACE; }
