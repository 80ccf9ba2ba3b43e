/* Signed distance of a world: the smallest of the distances to boxes, to spheres and to what a grid holds; negative inside.
 *
 *   box      p' = R' (p - c),  q = |p'| - h:    |max(q, 0)| + min(max(q_x, q_y, q_z), 0)
 *   sphere   |p - c| - r
 *   grid     trilinear between its nodes; outside it: the value at its nearest point plus the distance to that point */
#ifndef CONTROLLER_TAB_TAB_SDF_H_
#define CONTROLLER_TAB_TAB_SDF_H_

#include "controller/tab/tab.h"

#ifdef __cplusplus
extern "C" {
#endif

enum { TAB_SDF_SCHEMA = 1 }; /* layout of TabSdf; a table of another schema is refused */
enum {
  TAB_SDF_BOX = 15,   /* numbers of a box: centre (3), rotation R_WB row by row (9), half extents (3) */
  TAB_SDF_SPHERE = 4, /* of a sphere: centre (3), radius */
};

typedef struct TabSdf {
  TabHead head;             /* arrays: lo hi box sphere grid; inputs x, y, z [m] */
  int32_t nbox, nsphere;
  int32_t nx, ny, nz;       /* nodes of the grid; nx 0: no grid */
  int32_t grid_type;        /* TabType */
  float x0, y0, z0;         /* [m] first node */
  float spacing;            /* [m] */
  float grid_scale;         /* [m] distance = stored * grid_scale */
  const float* box;         /* (pad(nbox)/8, 15, 8)  at least one block, as below */
  const float* sphere;      /* (pad(nsphere)/8, 4, 8) */
  const void* grid;         /* (nz, ny, pad(nx)) */
} TabSdf;

/* Distance [m] and, where not NULL, its gradient (3) [-], from the nearest object; among equals boxes, then spheres, then the grid, the
 * lower index first. A query that is not finite: distance 0, gradient 0. No object at all: the distance is infinite.
 * 27 multiply-adds and a root per box, 4 and a root per sphere, 14 for the grid. */
TabStatus tab_sdf_eval(const TabSdf* tab, const double* p, float* distance, float* gradient);

#ifdef __cplusplus
}
#endif
#endif /* CONTROLLER_TAB_TAB_SDF_H_ */
