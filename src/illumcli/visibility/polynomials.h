/* Polynomials of least squares from sums of moments: the operations of regression.py in their order. */

#include "../compiled.h"

enum { FEATURES = 6, PAIRS = FEATURES * (FEATURES + 1) / 2 };
/* Rows of moments, as in regression.py. */
enum {
  COUNT = 0, FEATURE = 1, PAIR = FEATURE + FEATURES, HIDDEN = PAIR + PAIRS, HIDDEN_FEATURE = HIDDEN + 1,
  SQUARE = HIDDEN_FEATURE + FEATURES, MOMENTS = SQUARE + 1
};
enum { CONSTANT = 0, SLOPE = 1, COEFFICIENTS = SLOPE + FEATURES };
enum { LANES = 32 }; /* cells that are computed together, in a core's first cache */

#define NORMAL_RIDGE 1e-6
#define POSITION_RIDGE 1e-6
#define ROUNDING 4e-14
#define LEAST_COUNT 1e-30

typedef double Lanes[LANES];

#define EACH_LANE for (int64_t k = 0; k < LANES; k++)

/* One polynomial per lane. */
typedef struct {
  Lanes total, *means, *hidden, slopes[FEATURES], explained, lower[FEATURES][FEATURES], inverse[FEATURES];
} Polynomials;

/* From sums of moments, which become means, and to which the polynomials point. */
INLINE void solve(Lanes *sums, Polynomials *out) {
  Lanes covariance[FEATURES][FEATURES], scaled[FEATURES], forth[FEATURES], ridge;
  Lanes *means = sums + FEATURE, *hidden = sums + HIDDEN, (*lower)[FEATURES] = out->lower, *inverse = out->inverse;
  Lanes *slopes = out->slopes;
  out->means = means;
  out->hidden = hidden;
  EACH_LANE out->total[k] = greater(sums[COUNT][k], LEAST_COUNT);
  for (int plane = 0; plane < MOMENTS; plane++)
    EACH_LANE sums[plane][k] /= out->total[k];

  /* Covariances of the features, with a ridge, and with the hidden share. */
  for (int i = 0, pair = PAIR; i < FEATURES; i++) {
    for (int j = 0; j <= i; j++, pair++)
      EACH_LANE covariance[i][j][k] = sums[pair][k] - means[i][k] * means[j][k];
    EACH_LANE forth[i][k] = sums[HIDDEN_FEATURE + i][k] - means[i][k] * (*hidden)[k];
  }
  EACH_LANE ridge[k] =
      POSITION_RIDGE * (covariance[3][3][k] + covariance[4][4][k] + covariance[5][5][k]) + ROUNDING;
  for (int i = 0; i < FEATURES; i++)
    EACH_LANE covariance[i][i][k] += i < 3 ? NORMAL_RIDGE : ridge[k];

  /* Covariance = L D L^T; the slopes by substitution, forth and back. */
  for (int j = 0; j < FEATURES; j++) {
    for (int m = 0; m < j; m++) {
      EACH_LANE scaled[m][k] = lower[j][m][k] / inverse[m][k];
      EACH_LANE covariance[j][j][k] -= lower[j][m][k] * scaled[m][k];
    }
    EACH_LANE inverse[j][k] = 1 / greater(covariance[j][j][k], ROUNDING);
    for (int i = j + 1; i < FEATURES; i++) {
      for (int m = 0; m < j; m++)
        EACH_LANE covariance[i][j][k] -= lower[i][m][k] * scaled[m][k];
      EACH_LANE lower[i][j][k] = covariance[i][j][k] * inverse[j][k];
    }
  }
  EACH_LANE out->explained[k] = 0;
  for (int i = 0; i < FEATURES; i++) {
    for (int m = 0; m < i; m++)
      EACH_LANE forth[i][k] -= lower[i][m][k] * forth[m][k];
    EACH_LANE slopes[i][k] = forth[i][k] * inverse[i][k];
    EACH_LANE out->explained[k] += forth[i][k] * slopes[i][k];
  }
  for (int i = FEATURES - 1; i >= 0; i--)
    for (int m = i + 1; m < FEATURES; m++)
      EACH_LANE slopes[i][k] -= lower[m][i][k] * slopes[m][k];
}

/* Constant and slopes. */
INLINE void coefficients(const Polynomials *of, Lanes *out) {
  Lanes moved;
  EACH_LANE moved[k] = 0;
  for (int i = 0; i < FEATURES; i++) {
    EACH_LANE moved[k] += of->slopes[i][k] * of->means[i][k];
    EACH_LANE out[SLOPE + i][k] = of->slopes[i][k];
  }
  EACH_LANE out[CONSTANT][k] = (*of->hidden)[k] - moved[k];
}

/* Value and leverage where the features are `own`. */
INLINE void evaluate(const Polynomials *of, Lanes *own, double *value, double *leverage) {
  Lanes steps[FEATURES], rise, square;
  EACH_LANE rise[k] = square[k] = 0;
  for (int i = 0; i < FEATURES; i++) {
    EACH_LANE steps[i][k] = own[i][k] - of->means[i][k];
    EACH_LANE rise[k] += of->slopes[i][k] * steps[i][k];
  }
  for (int i = 0; i < FEATURES; i++) {
    for (int m = 0; m < i; m++)
      EACH_LANE steps[i][k] -= of->lower[i][m][k] * steps[m][k];
    EACH_LANE square[k] += steps[i][k] * steps[i][k] * of->inverse[i][k];
  }
  EACH_LANE value[k] = (*of->hidden)[k] + rise[k];
  EACH_LANE leverage[k] = (1 + square[k]) / of->total[k];
}
