/* What the loops in C share; compiled.py loads them. */

#include <stdint.h>

#if defined(_WIN32)
#define EXPORT __declspec(dllexport)
#else
#define EXPORT __attribute__((visibility("default")))
#endif
#if defined(_MSC_VER)
#define INLINE static __forceinline
#else
#define INLINE static inline __attribute__((always_inline))
#endif

INLINE double greater(double a, double b) { return a > b ? a : b; }

INLINE int64_t smaller(int64_t a, int64_t b) { return a < b ? a : b; }

/* (N, 3) numbers of 32 bits, of any strides [bytes]; CVectors of compiled.py. */
typedef struct {
  const char *data;
  int64_t stride, component;
} Vectors;

INLINE float component(const Vectors *of, int64_t i, int k) {
  return *(const float *)(of->data + i * of->stride + k * of->component);
}

INLINE int32_t number(const Vectors *of, int64_t i, int k) {
  return *(const int32_t *)(of->data + i * of->stride + k * of->component);
}
