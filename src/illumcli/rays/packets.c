/* Embree queries over arrays of rays, in packets of 4, 8 or 16 rays or ray by ray.

   This file needs no headers or libraries of Embree or Python. packet_loop.py passes the addresses of Embree's
   functions, and calls it by ctypes, without the interpreter lock. The layouts are those of RTCRay, RTCRay4, RTCRay8
   and RTCRay16 and of the hits that follow them (rtcore_ray.h, Embree 4). */

#include "../compiled.h"

#include <stddef.h>
#include <string.h>

enum { INTERFACE = 4 }; /* of packet_loop.py: both change together */
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

typedef struct {
  Function function; /* a PacketQuery such as rtcOccluded16; for packets of 1 a SingleQuery */
  void *scene, *arguments;
  int64_t width;
} Query;

typedef struct {
  Query query;
  int64_t first, end;       /* the rays of this call */
  int64_t rays_per_origin;  /* ray i starts at origin i / rays_per_origin */
  Vectors origins, directions;
  const float *limits;      /* [lengths of the direction] */
  int64_t limit_stride;     /* 0: one limit for all rays */
} Rays;

typedef struct {
  int32_t *triangle; /* -1 if nothing is hit; NULL: only distances are wanted */
  int32_t *instance; /* number of the geometry that is an instance; -1 if that is none */
  float *u, *v, *distance;
  uint8_t *doubtful; /* NULL: each ray of a packet is traced alone; else they are traced together, in half of the time,
                        and rays whose hits may depend on the others get a 1 */
} Hits;

/* Rays of points that each cast the directions of a pattern, turned into a frame of their own.

   Ray i of point p has direction x tangent + y bitangent + z normal, (x, y, z) column i of pattern `row[p]`. It starts at
   origin p * origins_per_point + origin_of_ray[i]. */
typedef struct {
  Query query;
  int64_t first, end;            /* the points of this call */
  int64_t samples;               /* rays of a point */
  int64_t origins_per_point;
  const float *frames;           /* (points, 3, 3): tangent, bitangent and normal of each */
  const float *patterns;         /* (rows, 3, samples) */
  const int32_t *row;            /* (points,) */
  const int32_t *number;         /* (samples,) number of each column, by which results are ordered */
  const int32_t *origin_of_ray;  /* (samples,) */
  const int32_t *first_mirrored; /* (points,) rays with a lower number are known to point above */
  Vectors origins, normals;      /* of the triangles that the rays leave; without data, no ray is mirrored */
  float limit;
  float least_height;            /* of a mirrored direction above its triangle */
} Patterns;

/* Results, of the rays of each point in the order of their numbers. */
typedef struct {
  int32_t *open;     /* (points,) rays that are not occluded */
  uint8_t *is_open;  /* (points, samples), or NULL */
  float *distance;   /* (points, samples) of the closest hit, or NULL */
  float *directions; /* (3, points, samples), or NULL */
  int64_t stride;    /* from one component of the directions to the next */
} PatternResults;

INLINE Cell *aligned(Cell *room) {
  return (Cell *)(((uintptr_t)room + ALIGNMENT - 1) & ~(uintptr_t)(ALIGNMENT - 1));
}

INLINE void prepare(Cell *packet, int64_t width) {
  for (int64_t j = 0; j < ROWS * width; j++)
    packet[j].bits = 0;
  for (int64_t j = 0; j < width; j++) {
    packet[MASK * width + j].bits = 0xffffffff;
    packet[ID * width + j].bits = (uint32_t)j;
  }
}

/* Whether the vectors lie component by component, without gaps, so that lanes can be copied together. */
INLINE int is_by_component(const Vectors *of) { return of->stride == sizeof(float); }

INLINE void copy(const Vectors *of, int64_t first, int64_t width, Cell *rows) {
  for (int k = 0; k < 3; k++)
    memcpy(rows + k * width, of->data + k * of->component + first * sizeof(float), width * sizeof(float));
}

/* Rays from `ray` on; lanes beyond the last ray repeat it and are not valid. */
INLINE void fill(const Rays *of, int64_t ray, int64_t width, Cell *packet, int32_t *valid) {
  int64_t last = of->end - 1;
  if (ray + width <= of->end && of->rays_per_origin == 1 && is_by_component(&of->origins) &&
      is_by_component(&of->directions)) {
    copy(&of->origins, ray, width, packet + ORG_X * width);
    copy(&of->directions, ray, width, packet + DIR_X * width);
    for (int64_t j = 0; j < width; j++) {
      packet[TFAR * width + j].real = of->limits[(ray + j) * of->limit_stride];
      valid[j] = -1;
    }
    return;
  }
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

INLINE void clear_hits(Cell *packet, int64_t width) {
  for (int64_t j = 0; j < width; j++) {
    packet[PRIMITIVE * width + j].number = -1;
    packet[GEOMETRY * width + j].number = -1;
    packet[INSTANCE * width + j].number = -1;
  }
}

INLINE void trace(const Query *query, int64_t width, const int32_t *valid, Cell *packet) {
  if (width == 1)
    ((SingleQuery)query->function)(query->scene, packet, query->arguments);
  else
    ((PacketQuery)query->function)(valid, query->scene, packet, query->arguments);
}

INLINE void occluded(const Rays *of, int64_t width, uint8_t *out) {
  Cell room[ROWS * WIDEST + ALIGNMENT], *packet = aligned(room);
  Cell mask[2 * WIDEST + ALIGNMENT];
  int32_t *valid = &aligned(mask)->number;
  prepare(packet, width);
  for (int64_t ray = of->first; ray < of->end; ray += width) {
    fill(of, ray, width, packet, valid);
    trace(&of->query, width, valid, packet);
    for (int64_t j = 0; j < width && ray + j < of->end; j++)
      out[ray + j] = packet[TFAR * width + j].real < 0; /* Embree sets it to -inf */
  }
}

/* Rays of a packet that are traced together: the order in which they meet triangles depends on all of them. It can decide
   which of two triangles at almost the same distance is hit, so such rays are noted. For this, triangles that are a
   little farther than the closest one are tested, too. */
#define NEAR 1e-4f     /* of the distance */
#define ROUNDING 6e-6f /* 100 ulp of single precision */
enum { COHERENT = 1 << 16, INVOKE_ARGUMENT_FILTER = 1 << 1 }; /* RTC_RAY_QUERY_FLAG_* */

typedef struct {
  uint8_t query[128]; /* RTCRayQueryContext, with room for what other versions add; all bits set: in no instance */
  float closest[WIDEST], margin[WIDEST]; /* distance of the closest triangle; how much farther others are near it */
  uint8_t has_rivals[WIDEST];
} Context;

typedef struct { /* RTCFilterFunctionNArguments */
  const int32_t *valid;
  void *geometry;
  Context *context;
  Cell *rays; /* their limits are the distances of the triangle */
  void *hits;
  uint32_t width;
} Candidates;

typedef struct { /* RTCIntersectArguments */
  uint32_t flags, feature_mask;
  Context *context;
  void (*filter)(const Candidates *);
  void *rest[4];
} Arguments;

INLINE float near(float distance, float margin) { return distance + NEAR * distance + margin; }

INLINE float largest(const Cell *vector, int64_t width) {
  float out = 0;
  for (int k = 0; k < 3; k++) {
    float x = vector[k * width].real;
    out = x > out ? x : -x > out ? -x : out;
  }
  return out;
}

/* Called by Embree with each triangle that rays hit within their limits. */
static void note_rivals(const Candidates *of) {
  for (int64_t j = 0, width = of->width; j < width; j++) {
    if (!of->valid[j])
      continue;
    Context *context = of->context;
    uint32_t ray = of->rays[ID * width + j].bits;
    float *limit = &of->rays[TFAR * width + j].real, *closest = &context->closest[ray];
    if (near(*limit, context->margin[ray]) >= *closest)
      context->has_rivals[ray] = 1;
    if (*limit < *closest)
      *closest = *limit;
    *limit = near(*closest, context->margin[ray]);
  }
}

/* Whether a ray is so nearly in the plane of the triangle it hit that its distance may be wrong by more than NEAR. */
INLINE int is_grazing(const Cell *ray, int64_t width, float distance) {
  double across = 0, area = 0, length = 0; /* the area is twice that of the triangle; all squared */
  for (int k = 0; k < 3; k++) {
    double normal = ray[(NORMAL_X + k) * width].real, direction = ray[(DIR_X + k) * width].real;
    across += normal * direction;
    area += normal * normal;
    length += direction * direction;
  }
  across *= across;
  double rounding = ROUNDING * ROUNDING * distance * distance * length;
  return across < 4e-4 * area * length || (across * across < rounding * rounding * area * length * length);
}

/* The results of `count` rays of a packet. */
INLINE void hand_over(const Cell *packet, const uint8_t *doubtful, int64_t ray, int64_t count, int64_t width,
                      const Hits *out) {
  if (out->doubtful)
    memcpy(out->doubtful + ray, doubtful, count);
  memcpy(out->distance + ray, packet + TFAR * width, count * sizeof(Cell));
  if (!out->triangle)
    return;
  memcpy(out->triangle + ray, packet + PRIMITIVE * width, count * sizeof(Cell));
  memcpy(out->instance + ray, packet + INSTANCE * width, count * sizeof(Cell));
  memcpy(out->u + ray, packet + U * width, count * sizeof(Cell));
  memcpy(out->v + ray, packet + V * width, count * sizeof(Cell));
}

INLINE void closest(const Rays *of, int64_t width, const Hits *out) {
  Cell room[ROWS * WIDEST + ALIGNMENT], *packet = aligned(room);
  Cell mask[2 * WIDEST + ALIGNMENT];
  int32_t *valid = &aligned(mask)->number;
  uint8_t doubtful[WIDEST];
  Query query = of->query;
  Context context;
  Arguments together = {COHERENT | INVOKE_ARGUMENT_FILTER, 0xffffffff, &context, note_rivals, {0}};
  if (out->doubtful) {
    query.arguments = &together;
    for (size_t k = 0; k < sizeof context.query; k++)
      context.query[k] = 0xff;
  }
  prepare(packet, width);
  for (int64_t ray = of->first; ray < of->end; ray += width) {
    fill(of, ray, width, packet, valid);
    clear_hits(packet, width);
    for (int64_t j = 0; out->doubtful && j < width; j++) {
      context.closest[j] = packet[TFAR * width + j].real;
      context.margin[j] = ROUNDING * largest(packet + j, width) / largest(packet + DIR_X * width + j, width);
      context.has_rivals[j] = 0;
    }
    trace(&query, width, valid, packet);
    for (int64_t j = 0; out->doubtful && j < width; j++) {
      packet[TFAR * width + j].real = context.closest[j];
      doubtful[j] = packet[PRIMITIVE * width + j].number < 0 || context.has_rivals[j] ||
                    is_grazing(packet + j, width, context.closest[j]);
    }
    if (ray + width <= of->end) /* a constant, for the compiler */
      hand_over(packet, doubtful, ray, width, width, out);
    else
      hand_over(packet, doubtful, ray, of->end - ray, width, out);
  }
}

/* Directions of `count` consecutive rays of a point into lanes of a packet; each product and sum is rounded. */
INLINE void turn(const Patterns *of, int64_t point, int64_t ray, int64_t count, int64_t width, Cell *lanes) {
  const float *__restrict x = of->patterns + of->row[point] * 3 * of->samples + ray;
  const float *__restrict y = x + of->samples, *__restrict z = y + of->samples;
  const float *t = of->frames + 9 * point, *b = t + 3, *n = t + 6;
  float t_x = t[0], t_y = t[1], t_z = t[2], b_x = b[0], b_y = b[1], b_z = b[2], n_x = n[0], n_y = n[1], n_z = n[2];
  float *__restrict d_x = &lanes[DIR_X * width].real, *__restrict d_y = d_x + width, *__restrict d_z = d_y + width;
  for (int64_t j = 0; j < count; j++) {
    d_x[j] = t_x * x[j] + b_x * y[j] + n_x * z[j];
    d_y[j] = t_y * x[j] + b_y * y[j] + n_y * z[j];
    d_z[j] = t_z * x[j] + b_z * y[j] + n_z * z[j];
  }
}

/* Mirrors those directions that point below the triangle they leave. */
INLINE void mirror(const Patterns *of, int64_t point, int64_t ray, int64_t count, int64_t width, Cell *lanes) {
  Cell *x = lanes + DIR_X * width, *y = x + width, *z = y + width;
  const int32_t *number = of->number + ray, first = of->first_mirrored[point];
  int32_t candidates = 0;
  for (int64_t j = 0; j < count; j++)
    candidates += number[j] >= first;
  if (!candidates)
    return;
  for (int64_t j = 0; j < count; j++) {
    if (number[j] < first)
      continue;
    int64_t triangle = point * of->origins_per_point + of->origin_of_ray[ray + j];
    float n_x = component(&of->normals, triangle, 0), n_y = component(&of->normals, triangle, 1);
    float n_z = component(&of->normals, triangle, 2);
    float height = x[j].real * n_x + y[j].real * n_y + z[j].real * n_z;
    if (height < of->least_height) {
      float up = (-height > of->least_height ? -height : of->least_height) - height;
      x[j].real += up * n_x;
      y[j].real += up * n_y;
      z[j].real += up * n_z;
    }
  }
}

/* `count` consecutive rays of a point into lanes of a packet. */
INLINE void place(const Patterns *of, int64_t point, int64_t ray, int64_t count, int64_t width, Cell *lanes) {
  turn(of, point, ray, count, width, lanes);
  if (of->normals.data && of->first_mirrored[point] < of->samples)
    mirror(of, point, ray, count, width, lanes);
  for (int k = 0; k < 3; k++) {
    float *__restrict o = &lanes[(ORG_X + k) * width].real;
    int64_t first = point * of->origins_per_point;
    float only = component(&of->origins, first, k);
    for (int64_t j = 0; j < count; j++)
      o[j] = of->origins_per_point == 1 ? only : component(&of->origins, first + of->origin_of_ray[ray + j], k);
  }
  for (int64_t j = 0; j < count; j++)
    lanes[TFAR * width + j].real = of->limit;
}

/* The results of `count` consecutive rays of a point. */
INLINE void record(const Patterns *of, int64_t point, int64_t ray, int64_t count, int64_t width, const Cell *lanes,
                   const PatternResults *out) {
  const Cell *far = lanes + TFAR * width;
  int32_t open = 0;
  for (int64_t j = 0; j < count; j++)
    open += far[j].number >= 0; /* Embree sets the limit of occluded rays to -inf */
  out->open[point] += open;
  if (!out->is_open && !out->distance && !out->directions)
    return;
  for (int64_t j = 0; j < count; j++) {
    int64_t i = point * of->samples + of->number[ray + j];
    if (out->is_open)
      out->is_open[i] = far[j].number >= 0;
    if (out->distance)
      out->distance[i] = far[j].real;
    for (int64_t k = 0; k < 3 && out->directions; k++)
      out->directions[k * out->stride + i] = lanes[(DIR_X + k) * width + j].real;
  }
}

INLINE void patterns(const Patterns *of, int64_t width, const PatternResults *out) {
  Cell room[ROWS * WIDEST + ALIGNMENT], *packet = aligned(room);
  Cell mask[2 * WIDEST + ALIGNMENT];
  int32_t *valid = &aligned(mask)->number;
  prepare(packet, width);
  for (int64_t j = 0; j < width; j++)
    valid[j] = -1;
  int64_t point = of->first, ray = 0;
  while (point < of->end) {
    /* Fill the packet from one point after the other. */
    int64_t first_point = point, first_ray = ray, filled = 0;
    while (filled < width && point < of->end) {
      int64_t count = width - filled < of->samples - ray ? width - filled : of->samples - ray;
      if (count == width) /* a constant, for the compiler */
        place(of, point, ray, width, width, packet);
      else
        place(of, point, ray, count, width, packet + filled);
      filled += count;
      ray += count;
      if (ray == of->samples) {
        ray = 0;
        point++;
      }
    }
    for (int64_t j = filled; j < width; j++)
      valid[j] = 0;
    if (out->distance)
      clear_hits(packet, width);
    trace(&of->query, width, valid, packet);

    /* Hand the results to the same points. */
    for (int64_t p = first_point, r = first_ray, done = 0; done < filled; p++, r = 0) {
      int64_t count = filled - done < of->samples - r ? filled - done : of->samples - r;
      if (count == width)
        record(of, p, r, width, width, packet, out);
      else
        record(of, p, r, count, width, packet + done, out);
      done += count;
    }
  }
}

/* A constant width, so that each width has a loop of its own. */
#define FOR_WIDTH(function, of, out)       \
  switch ((of)->query.width) {             \
    case 16: function(of, 16, out); break; \
    case 8: function(of, 8, out); break;   \
    case 4: function(of, 4, out); break;   \
    default: function(of, 1, out);         \
  }

EXPORT int32_t illum_interface(void) { return INTERFACE; }

/* 1 for each ray with a triangle between its origin and its limit. */
EXPORT void illum_occluded(const Rays *of, uint8_t *out) {
  FOR_WIDTH(occluded, of, out)
}

/* The closest hit of each ray. */
EXPORT void illum_closest(const Rays *of, const Hits *out) {
  FOR_WIDTH(closest, of, out)
}

/* Traces patterns of rays about points, and counts those that are open. */
EXPORT void illum_patterns(const Patterns *of, const PatternResults *out) {
  FOR_WIDTH(patterns, of, out)
}
