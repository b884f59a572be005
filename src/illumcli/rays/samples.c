/* Camera rays and the surfaces that they hit, sample by sample.

   The operations of camera.py, interaction.py and offsets.py in their order, so that the results have the same bits.
   compiled_samples.py calls this file by ctypes, without the interpreter lock. */

#include "../compiled.h"

#include <float.h>
#include <math.h>

enum { INTERFACE = 3 }; /* of compiled_samples.py: both change together */

#define CLEAR 1.25    /* rays start so far before they are closest to the centre [radii] */
#define LONGEST 100.0 /* effective edge [radii] */

INLINE float greater_float(float a, float b) { return a > b ? a : b; }

typedef struct {
  double right[3], up[3], forward[3], eye[3];
  double right_eye, up_eye, forward_eye; /* products of the axes and the eye */
  double slope;                          /* of the upper edge of the image */
  double width, height;                  /* [pixels] */
} Pinhole;

/* Rays through positions on the film, (2, count); origins and directions are (3, count). */
EXPORT void illum_camera_rays(const Pinhole *camera, const double *points, int64_t count, float *origins,
                              float *directions, double *start_distance) {
  for (int64_t i = 0; i < count; i++) {
    double x = camera->slope * ((2 * points[i] - camera->width) / camera->height);
    double y = camera->slope * (1 - 2 * points[count + i] / camera->height);
    double scale = 1 / sqrt(1 + x * x + y * y);
    x *= scale;
    y *= scale;
    double along = -(scale * camera->forward_eye + x * camera->right_eye + y * camera->up_eye);
    double start = greater(along - CLEAR, 0);
    for (int k = 0; k < 3; k++) {
      double d = scale * camera->forward[k] + x * camera->right[k] + y * camera->up[k];
      directions[k * count + i] = (float)d;
      origins[k * count + i] = (float)(camera->eye[k] + start * d);
    }
    start_distance[i] = start;
  }
}

typedef struct {
  Vectors vertices, triangles, towards_eye;
  const int32_t *triangle; /* (count,) */
  const float *u, *v;      /* (count,) */
  int64_t count;           /* of hits */
} SurfaceHits;

typedef struct {
  double *position;     /* (3, count) */
  float *ng, *edge;     /* (3, count), (count,) */
  uint8_t *back_facing; /* (count,) */
} Surface;

INLINE double dot(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

INLINE float square(const double *a) {
  float x = (float)a[0], y = (float)a[1], z = (float)a[2];
  return x * x + y * y + z * z;
}

EXPORT void illum_surface(const SurfaceHits *hits, const Surface *out) {
  for (int64_t i = 0; i < hits->count; i++) {
    /* The triangle's first vertex and its edges. */
    double v0[3], e1[3], e2[3], e3[3], eye[3];
    int32_t corner[3];
    for (int k = 0; k < 3; k++)
      corner[k] = number(&hits->triangles, hits->triangle[i], k);
    for (int k = 0; k < 3; k++) {
      v0[k] = component(&hits->vertices, corner[0], k);
      e1[k] = component(&hits->vertices, corner[1], k) - v0[k];
      e2[k] = component(&hits->vertices, corner[2], k) - v0[k];
      e3[k] = e2[k] - e1[k];
      eye[k] = component(&hits->towards_eye, i, k);
    }

    /* Its longest edge in single precision, its normal in double. */
    float edge = sqrtf(greater_float(greater_float(square(e1), square(e2)), square(e3)));
    double normal[3] = {
        e1[1] * e2[2] - e1[2] * e2[1],
        e1[2] * e2[0] - e1[0] * e2[2],
        e1[0] * e2[1] - e1[1] * e2[0],
    };
    double area = sqrt(dot(normal, normal));
    int is_back = dot(normal, eye) < 0;
    double scale = (is_back ? -1.0 : 1.0) / greater(area, DBL_MIN);
    out->back_facing[i] = (uint8_t)is_back;
    for (int k = 0; k < 3; k++) {
      out->position[k * hits->count + i] = v0[k] + e1[k] * hits->u[i] + e2[k] * hits->v[i];
      out->ng[k * hits->count + i] = (float)(normal[k] * scale);
    }

    /* The effective edge. */
    double aspect = (edge * edge) / greater(4 * area, FLT_MIN);
    double effective = edge * greater(aspect, 1), longest = greater_float(edge, (float)LONGEST);
    out->edge[i] = (float)(effective < longest ? effective : longest);
  }
}

/* As in offsets.py. */
#define ORIGIN_OFFSET (4.0 / (1 << 24))
#define ULP (1.0 / (1 << 23))

/* Origins of rays above the triangles they leave, (3, count) as are positions and normals. */
EXPORT void illum_ray_origins(const double *position, const float *ng, const float *edge, int64_t count,
                              float *origins) {
  for (int64_t i = 0; i < count; i++) {
    double across[3];
    for (int k = 0; k < 3; k++)
      across[k] = fabs((double)ng[k * count + i]) * fabs(position[k * count + i]);
    double offset = ORIGIN_OFFSET * (across[0] + across[1] + across[2] + edge[i]);
    for (int k = 0; k < 3; k++) {
      double p = position[k * count + i], n = ng[k * count + i];
      origins[k * count + i] = (float)(offset * n + copysign(fabs(p) * ULP, n) + p);
    }
  }
}

typedef struct {
  Vectors corners, values;  /* corners of triangles, (triangles, 3); normals, (rows, 3) */
  const int32_t *index;     /* row of the normal of each corner; from the end, if it is negative */
  int64_t rows, count;      /* of normals, of hits */
  const int32_t *triangle;  /* (count,) */
  const float *u, *v, *ng;  /* (count,), (count,), (3, count) */
  const uint8_t *back_facing;
} NormalHits;

INLINE float dot_float(const float *a) { return a[0] * a[0] + a[1] * a[1] + a[2] * a[2]; }

/* Unit normals on the eye's side, (3, count), interpolated linearly; the triangle's where they vanish. */
EXPORT void illum_normals(const NormalHits *hits, float *out) {
  for (int64_t i = 0; i < hits->count; i++) {
    float weight[3] = {1 - hits->u[i] - hits->v[i], hits->u[i], hits->v[i]}, n[3] = {0, 0, 0};
    for (int k = 0; k < 3; k++) {
      int64_t row = hits->index[number(&hits->corners, hits->triangle[i], k)];
      row += row < 0 ? hits->rows : 0;
      for (int c = 0; c < 3; c++) {
        float part = weight[k] * component(&hits->values, row, c);
        n[c] = k ? n[c] + part : part;
      }
    }
    float scale = 1 / greater_float(sqrtf(dot_float(n)), FLT_MIN), side = hits->back_facing[i] ? -1.0f : 1.0f;
    for (int c = 0; c < 3; c++)
      n[c] = n[c] * scale * side;
    int has_vanished = !(dot_float(n) > 0.25f);
    for (int c = 0; c < 3; c++)
      out[c * hits->count + i] = has_vanished ? hits->ng[c * hits->count + i] : n[c];
  }
}

EXPORT int illum_interface(void) { return INTERFACE; }
