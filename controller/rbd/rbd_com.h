// Centre of mass and its Jacobian.
#ifndef CONTROLLER_RBD_RBD_COM_H_
#define CONTROLLER_RBD_RBD_COM_H_

#include "controller/rbd/rbd_kinematics.h"

namespace engram {

// Total mass [kg]: a constant of the robot.
template <class R> constexpr double total_mass() {
  double m = 0.0;
  for (int i = 0; i < R::nj; ++i) m += R::mass[i];
  return m;
}

// d.Yc: mass and first moment of every subtree (no rotational inertia). After rbd_kinematics.
template <class R, class S> inline void rbd_subtree_moments(RbdData<R, S>& d) {
  for (int i = 0; i < R::nj; ++i) {
    d.Yc[i].mass = S(R::mass[i]);
    d.Yc[i].moment = mul_add(d.R_WJ[i], constant3<S>(R::com[i]), d.p_WJ[i]) * S(R::mass[i]);
  }
  for (int i = R::nj - 1; i >= 0; --i) {
    const int p = R::parent[i];
    if (p < 0) continue;
    d.Yc[p].mass += d.Yc[i].mass;
    d.Yc[p].moment += d.Yc[i].moment;
  }
}

// Centre of mass [m]. After rbd_subtree_moments or rbd_composite_inertias.
template <class R, class S> inline Vec3<S> rbd_com(const RbdData<R, S>& d) {
  Vec3<S> moment = Vec3<S>::Zero();
  for (int i = 0; i < R::nj; ++i)
    if (R::parent[i] < 0) moment += d.Yc[i].moment;
  return moment * S(1.0 / total_mass<R>());
}

// Column k of the Jacobian of the centre of mass: d com / d q_k = (momentum of the subtree of k) / mass. Same preconditions.
template <class R, class S> inline Vec3<S> rbd_com_column(const RbdData<R, S>& d, int k) {
  const Inertia<S>& Y = d.Yc[kTree<R>.joint[k]];
  return cross_add<S>(d.J[k].ang, Y.moment, d.J[k].lin * Y.mass) * S(1.0 / total_mass<R>());
}

}  // namespace engram
#endif  // CONTROLLER_RBD_RBD_COM_H_
