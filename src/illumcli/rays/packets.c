/* Embree queries over arrays of rays, in packets of 4, 8 or 16 rays or ray by ray.

   This file needs no headers or libraries of Embree or Python. packet_loop.py passes the addresses of Embree's
   functions, and calls it by ctypes, without the interpreter lock. The layouts are those of RTCRay, RTCRay4, RTCRay8
   and RTCRay16 and of the hits that follow them (rtcore_ray.h, Embree 4). */

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

enum { INTERFACE = 1 }; /* of packet_loop.py: both change together */
enum { WIDEST = 16, ALIGNMENT = 64 };

/* Rows of a packet, each of as many cells as the packet has rays; the hit begins with its normal. */
enum {
  ORG_X = 0, TNEAR = 3, DIR_X = 4, TIME = 7, TFAR = 8, MASK = 9, ID = 10, FLAGS = 11,
  NORMAL_X = 12, U = 15, V = 16, PRIMITIVE = 17, GEOMETRY = 18, INSTANCE = 19,
  ROWS = 32 /* more than Embree knows: instances may have several levels */
};

typedef union {
  float real;
  uint32_t bits;
  int32_t number;
} Cell;

typedef void (*Function)(void);
typedef void (*PacketQuery)(const int32_t *valid, void *scene, void *rays, void *arguments);
typedef void (*SingleQuery)(void *scene, void *ray, void *arguments);

/* (N, 3) float32, of any strides [bytes]. */
typedef struct {
  const char *data;
  int64_t stride, component;
} Vectors;

typedef struct {
  Function query; /* a PacketQuery such as rtcOccluded16; for packets of 1 a SingleQuery */
  void *scene, *arguments;
  int64_t width;
  int64_t first, end;       /* the rays of this call */
  int64_t rays_per_origin;  /* ray i starts at origin i / rays_per_origin */
  Vectors origins, directions;
  const float *limits;      /* [lengths of the direction] */
  int64_t limit_stride;     /* 0: one limit for all rays */
} Rays;

typedef struct {
  int32_t *triangle; /* -1 if nothing is hit; NULL: only distances are wanted */
  float *u, *v, *distance;
} Hits;

INLINE float component(const Vectors *of, int64_t i, int k) {
  return *(const float *)(of->data + i * of->stride + k * of->component);
}

INLINE Cell *aligned(Cell *room) {
  return (Cell *)(((uintptr_t)room + ALIGNMENT - 1) & ~(uintptr_t)(ALIGNMENT - 1));
}

INLINE void prepare(Cell *packet, int64_t width) {
  for (int64_t j = 0; j < width; j++) {
    packet[TNEAR * width + j].real = 0;
    packet[TIME * width + j].real = 0;
    packet[MASK * width + j].bits = 0xffffffff;
    packet[ID * width + j].bits = (uint32_t)j;
    packet[FLAGS * width + j].bits = 0;
  }
}

/* Rays from `ray` on; lanes beyond the last ray repeat it and are not valid. */
INLINE void fill(const Rays *of, int64_t ray, int64_t width, Cell *packet, int32_t *valid) {
  int64_t last = of->end - 1;
  int64_t origin = ray / of->rays_per_origin, place = ray % of->rays_per_origin;
  for (int64_t j = 0; j < width; j++) {
    int64_t i = ray + j < last ? ray + j : last;
    for (int k = 0; k < 3; k++) {
      packet[(ORG_X + k) * width + j].real = component(&of->origins, origin, k);
      packet[(DIR_X + k) * width + j].real = component(&of->directions, i, k);
    }
    packet[TFAR * width + j].real = of->limits[i * of->limit_stride];
    valid[j] = ray + j <= last ? -1 : 0;
    if (i < last && ++place == of->rays_per_origin) {
      place = 0;
      origin++;
    }
  }
}

INLINE void ask(const Rays *of, int64_t width, const int32_t *valid, Cell *packet) {
  if (width == 1)
    ((SingleQuery)of->query)(of->scene, packet, of->arguments);
  else
    ((PacketQuery)of->query)(valid, of->scene, packet, of->arguments);
}

INLINE void occluded(const Rays *of, int64_t width, uint8_t *out) {
  Cell room[ROWS * WIDEST + ALIGNMENT], *packet = aligned(room);
  Cell mask[2 * WIDEST + ALIGNMENT];
  int32_t *valid = &aligned(mask)->number;
  prepare(packet, width);
  for (int64_t ray = of->first; ray < of->end; ray += width) {
    fill(of, ray, width, packet, valid);
    ask(of, width, valid, packet);
    for (int64_t j = 0; j < width && ray + j < of->end; j++)
      out[ray + j] = packet[TFAR * width + j].real < 0; /* Embree sets it to -inf */
  }
}

INLINE void closest(const Rays *of, int64_t width, const Hits *out) {
  Cell room[ROWS * WIDEST + ALIGNMENT], *packet = aligned(room);
  Cell mask[2 * WIDEST + ALIGNMENT];
  int32_t *valid = &aligned(mask)->number;
  prepare(packet, width);
  for (int64_t ray = of->first; ray < of->end; ray += width) {
    fill(of, ray, width, packet, valid);
    for (int64_t j = 0; j < width; j++) {
      packet[PRIMITIVE * width + j].number = -1;
      packet[GEOMETRY * width + j].number = -1;
      packet[INSTANCE * width + j].number = -1;
    }
    ask(of, width, valid, packet);
    for (int64_t j = 0; j < width && ray + j < of->end; j++) {
      out->distance[ray + j] = packet[TFAR * width + j].real;
      if (!out->triangle)
        continue;
      out->triangle[ray + j] = packet[PRIMITIVE * width + j].number;
      out->u[ray + j] = packet[U * width + j].real;
      out->v[ray + j] = packet[V * width + j].real;
    }
  }
}

EXPORT int32_t illum_interface(void) { return INTERFACE; }

/* 1 for each ray with a triangle between its origin and its limit. */
EXPORT void illum_occluded(const Rays *of, uint8_t *out) {
  switch (of->width) {
    case 16: occluded(of, 16, out); break;
    case 8: occluded(of, 8, out); break;
    case 4: occluded(of, 4, out); break;
    default: occluded(of, 1, out);
  }
}

/* The closest hit of each ray. */
EXPORT void illum_closest(const Rays *of, const Hits *out) {
  switch (of->width) {
    case 16: closest(of, 16, out); break;
    case 8: closest(of, 8, out); break;
    case 4: closest(of, 4, out); break;
    default: closest(of, 1, out);
  }
}
