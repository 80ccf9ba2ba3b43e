#include "controller/tab/tab_sdf.h"

#include "controller/tab/tab_lanes.h"

#include <cmath>

using namespace engram;

namespace {

struct Nearest {
  float distance = INFINITY;
  const float* object = nullptr;  // its first number, the others follow at a stride of TAB_LANES
  bool box = false;
};

// Distance to a box, and where not null its gradient in the world
float box_distance(const float* box, const float* p, float* gradient) {
  float local[3], outside2 = 0;
  int axis = 0;
  float q[3];
  for (int i = 0; i < 3; ++i) {
    local[i] = 0;
    for (int j = 0; j < 3; ++j) local[i] += box[(3 + 3 * j + i) * TAB_LANES] * (p[j] - box[j * TAB_LANES]);
    q[i] = std::fabs(local[i]) - box[(12 + i) * TAB_LANES];
    if (q[i] > q[axis]) axis = i;
    const float out = std::fmax(q[i], 0.0f);
    outside2 += out * out;
  }
  const float distance = q[axis] > 0 ? std::sqrt(outside2) : q[axis];
  if (gradient) {
    float g[3];
    for (int i = 0; i < 3; ++i) {
      const float size = q[axis] > 0 ? std::fmax(q[i], 0.0f) / distance : i == axis;
      g[i] = std::copysign(size, local[i]);
    }
    for (int i = 0; i < 3; ++i) {
      gradient[i] = 0;
      for (int j = 0; j < 3; ++j) gradient[i] += box[(3 + 3 * i + j) * TAB_LANES] * g[j];
    }
  }
  return distance;
}

float sphere_distance(const float* sphere, const float* p, float* gradient) {
  float d[3], norm2 = 0;
  for (int i = 0; i < 3; ++i) {
    d[i] = p[i] - sphere[i * TAB_LANES];
    norm2 += d[i] * d[i];
  }
  const float norm = std::sqrt(norm2);
  for (int i = 0; gradient && i < 3; ++i) gradient[i] = norm > 0 ? d[i] / norm : 0;
  return norm - sphere[3 * TAB_LANES];
}

// Trilinear: cell and fraction of every axis, the value and its gradient
float grid_distance(const TabSdf* tab, const float* p, float* gradient) {
  const int32_t n[3] = {tab->nx, tab->ny, tab->nz};
  const float origin[3] = {tab->x0, tab->y0, tab->z0};
  int32_t cell[3];
  float f[3], beyond[3], beyond2 = 0;
  for (int i = 0; i < 3; ++i) {
    const float at = (p[i] - origin[i]) / tab->spacing;
    const float inside = std::fmin(std::fmax(at, 0.0f), static_cast<float>(n[i] - 1));
    cell[i] = static_cast<int32_t>(inside);
    if (cell[i] > n[i] - 2) cell[i] = n[i] - 2;
    f[i] = inside - static_cast<float>(cell[i]);
    beyond[i] = (at - inside) * tab->spacing;
    beyond2 += beyond[i] * beyond[i];
  }
  float corner[2][2][2];
  const int64_t row = tab_pad(tab->nx);
  tab_with_type(tab->grid_type, [&](auto type) {
    for (int k = 0; k < 2; ++k) {
      for (int j = 0; j < 2; ++j) {
        const int64_t first = ((cell[2] + k) * int64_t{tab->ny} + cell[1] + j) * row + cell[0];
        for (int i = 0; i < 2; ++i) corner[k][j][i] = tab_at<type>(tab->grid, first + i) * tab->grid_scale;
      }
    }
  });
  const auto mix = [](float a, float b, float t) { return a + t * (b - a); };
  float x[2][2], y[2];
  for (int k = 0; k < 2; ++k) {
    for (int j = 0; j < 2; ++j) x[k][j] = mix(corner[k][j][0], corner[k][j][1], f[0]);
    y[k] = mix(x[k][0], x[k][1], f[1]);
  }
  const float far = std::sqrt(beyond2);
  if (gradient) {
    const auto slope_x = [&](int k, int j) { return corner[k][j][1] - corner[k][j][0]; };
    gradient[0] = mix(mix(slope_x(0, 0), slope_x(0, 1), f[1]), mix(slope_x(1, 0), slope_x(1, 1), f[1]), f[2]) / tab->spacing;
    gradient[1] = mix(x[0][1] - x[0][0], x[1][1] - x[1][0], f[2]) / tab->spacing;
    gradient[2] = (y[1] - y[0]) / tab->spacing;
    for (int i = 0; i < 3; ++i) {
      if (beyond[i] != 0) gradient[i] = beyond[i] / far;  // the value at the nearest point no longer moves along this axis
    }
  }
  return mix(y[0], y[1], f[2]) + far;
}

// The nearest of n objects of `numbers` numbers each, in blocks of TAB_LANES
template <class F> void search(const float* block, int32_t n, int32_t numbers, bool box, Nearest& nearest, F distance) {
  for (int32_t i = 0; i < n; ++i) {
    const float* object = block + (i / TAB_LANES) * numbers * TAB_LANES + i % TAB_LANES;
    const float d = distance(object);
    if (d < nearest.distance) nearest = {d, object, box};
  }
}

}  // namespace

extern "C" TabStatus tab_sdf_eval(const TabSdf* tab, const double* p, float* distance, float* gradient) {
  *distance = 0;
  for (int i = 0; gradient && i < 3; ++i) gradient[i] = 0;
  const TabStatus status = tab_domain(&tab->head, p);
  if (status == kTabNotFinite) return status;
  float point[3];
  for (int i = 0; i < 3; ++i) point[i] = std::fmin(std::fmax(static_cast<float>(p[i]), -TAB_FAR), TAB_FAR);
  Nearest nearest;
  search(tab->box, tab->nbox, TAB_SDF_BOX, true, nearest, [&](const float* box) { return box_distance(box, point, nullptr); });
  search(tab->sphere, tab->nsphere, TAB_SDF_SPHERE, false, nearest, [&](const float* s) { return sphere_distance(s, point, nullptr); });
  if (tab->nx > 0) {
    const float d = grid_distance(tab, point, nullptr);
    if (d < nearest.distance) {
      *distance = d;
      if (gradient) grid_distance(tab, point, gradient);
      return status;
    }
  }
  *distance = nearest.distance;
  if (gradient && nearest.object) nearest.box ? box_distance(nearest.object, point, gradient) : sphere_distance(nearest.object, point, gradient);
  return status;
}
