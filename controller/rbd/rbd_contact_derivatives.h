// Derivatives of the dynamics with contacts, up to the last triangular solve.
//
// Seen from axes that move with its body, a contact force is a force at rest: with T = J a + a0 = 0 the total constraint,
//   M da = -dtau dz + J' dlambda,   J da = -dT dz
// where dtau is the derivative of inverse dynamics under the net forces (rbd_rnea_derivatives) and dT that of T at fixed a. With
// X = L^-T dtau, which is as sparse as the tree's branches,
//   dlambda = G^-1 (U' X - dT)    da = L^-1 (U dlambda - D^-1 X)
// X and U' X - dT are formed here; what remains is dense and left to ocp_contact_model.h, a knot at a time.
//
// dT along the path of contact c at body i, with dVdq_k, dAdq_k, dAdv_k of rbd_derivatives.h:
//   surface: dT/dq_k = dAdq_k + dVdq_k x V_i + kd dVdq_k       dT/dv_k = dAdv_k + J_k x V_i + kd J_k      moved to the contact
//   point:   dT/dq_k = dAdq_k + 2 w(dVdq_k) x u + kd dVdq_k    dT/dv_k = dAdv_k + 2 w_k x u + kd J_k      linear part, u its velocity
#ifndef CONTROLLER_RBD_RBD_CONTACT_DERIVATIVES_H_
#define CONTROLLER_RBD_RBD_CONTACT_DERIVATIVES_H_

#include "controller/rbd/rbd_contact.h"
#include "controller/rbd/rbd_derivatives.h"

namespace engram {

// Over z = (q, v, u) of nv, nv and nu coordinates.
template <class C, int nu, class S> struct ContactDerivatives {
  static constexpr int nv = C::Robot::nv, nf = kContactRows<C>;
  Mat<S, nv, nv> Xq, Xv;                 // L^-T dtau/dq, L^-T dtau/dv; entries of dofs on different branches are zero
  S Xu[nv][nu];                          // L^-T dtau/du
  S Bq[nf][nv], Bv[nf][nv], Bu[nf][nu];  // U' X - dT, rows of active contacts
};

// X := L^-T X, whose entries of dofs on different branches are zero and stay so.
template <class R, class S> inline void rbd_solve_upper_related(const RbdData<R, S>& d, Mat<S, R::nv, R::nv>& X) {
  constexpr const Tree<R>& tree = kTree<R>;
  for (int k = R::nv - 1; k >= 0; --k)
    for (int j = tree.parent[k]; j >= 0; j = tree.parent[j]) {
      const S l = d.L(k, j);
      for (int m = tree.parent[k]; m >= 0; m = tree.parent[m]) X(j, m) = nmadd(l, X(k, m), X(j, m));
      for (int m = k; m < tree.end[k]; ++m) X(j, m) = nmadd(l, X(k, m), X(j, m));
    }
}

// d.A and d.f at joint accelerations a, the contact forces taken off d.f. After rbd_contact_dynamics.
template <class C, class R, class S>
inline void rbd_contact_accelerate(const S* a, unsigned active, const ContactData<C, S>& cd, RbdData<R, S>& d) {
  rbd_accelerate(a, d);
  rbd_take_contact_forces(active, cd, d);
}

// d.f -= contact forces.
template <class C, class R, class S>
inline void rbd_take_contact_forces(unsigned active, const ContactData<C, S>& cd, RbdData<R, S>& d) {
  constexpr const ContactTree<C>& tree = kContactTree<C>;
  for (int c = 0; c < C::n; ++c) {
    if (!contact_active(active, c)) continue;
    const S* const l = cd.lambda + tree.first[c];
    const Vec3<S> f(l[0], l[1], l[2]);
    Force<S>& net = d.f[tree.joint[c]];
    net.lin -= f;
    net.ang -= cross(cd.p_WF[c], f);
    if (C::kind[c] == ContactKind::kSurface) net.ang -= Vec3<S>(l[3], l[4], l[5]);
  }
}

// dT of contact c along its path: dTq[a][r], dTv[a][r] for path dof a and row r. d.A is at the constrained acceleration.
template <class C, class R, class S>
inline void rbd_contact_constraint_derivatives(const RbdData<R, S>& d, const ContactData<C, S>& cd, int c,
                                               S (&dTq)[ContactData<C, S>::np][6], S (&dTv)[ContactData<C, S>::np][6]) {
  constexpr const ContactTree<C>& tree = kContactTree<C>;
  const Vec3<S> p = cd.p_WF[c], g = constant3<S>(R::gravity);
  const Motion<S> Vi = d.V[tree.joint[c]];
  const Vec3<S> u = moved_to(Vi, p).lin;
  const bool point = C::kind[c] == ContactKind::kPoint;
  for (int a = 0; a < tree.path_n[c]; ++a) {
    const int k = tree.path[c][a], parent = R::parent[kTree<R>.joint[k]];
    const Motion<S>& J = d.J[k];
    Motion<S> dVdq = Motion<S>::zero(), dAdq = Motion<S>::zero(), dAdv;
    if (parent < 0) {
      dAdv = cross(d.V[kTree<R>.joint[k]], J);
    } else {
      dVdq = cross(d.V[parent], J);
      dAdq = cross_add(d.A[parent], J, cross(d.V[parent], dVdq));
      dAdq.lin = cross_add(g, J.ang, dAdq.lin);  // d.A is the acceleration minus gravity
      dAdv = dVdq * S(2.0);
    }
    Motion<S> Tq, Tv;
    if (point) {
      Tq = moved_to(dAdq, p);
      Tv = moved_to(dAdv, p);
      Tq.lin = cross_add<S>(dVdq.ang * S(2.0), u, Tq.lin);
      Tv.lin = cross_add<S>(J.ang * S(2.0), u, Tv.lin);
    } else {
      Tq = moved_to(cross_add(dVdq, Vi, dAdq), p);
      Tv = moved_to(cross_add(J, Vi, dAdv), p);
    }
    Tq = madd(moved_to(dVdq, p), S(C::kd), Tq);
    Tv = madd(cd.J[c][a], S(C::kd), Tv);
    if constexpr (C::kp > 0.0) Tq = madd(rbd_contact_error_derivative(cd, c, a), S(C::kp), Tq);
    for (int r = 0; r < tree.rows[c]; ++r) {
      dTq[a][r] = motion_entry(Tq, r);
      dTv[a][r] = motion_entry(Tv, r);
    }
  }
}

// Derivative of cd.error[c] along path dof a, seen from axes that move with the body.
template <class C, class S> inline Motion<S> rbd_contact_error_derivative(const ContactData<C, S>& cd, int c, int a) {
  const Motion<S>& J = cd.J[c][a];
  if (C::kind[c] == ContactKind::kPoint) return {J.lin - cross(J.ang, cd.error[c].lin), Vec3<S>::Zero()};
  const Vec3<S> lin = mul_transposed(cd.R_WF[c], J.lin), ang = mul_transposed(cd.R_WF[c], J.ang);
  S e[6];
  for (int i = 0; i < 6; ++i) {
    e[i] = 0.0;
    for (int j = 0; j < 3; ++j) e[i] += cd.Jlog[c](i, j) * lin[j] + cd.Jlog[c](i, 3 + j) * ang[j];
  }
  return {mul(cd.R_WF[c], Vec3<S>(e[0], e[1], e[2])), mul(cd.R_WF[c], Vec3<S>(e[3], e[4], e[5]))};
}

// out.B = U' X - dT from out.X, given dT of every active contact by constraint(c, dTq, dTv).
template <class C, int nu, class S, class Constraint>
inline void rbd_contact_right_sides(unsigned active, const ContactData<C, S>& cd, const int (&u_dof)[nu],
                                    ContactDerivatives<C, nu, S>& out, Constraint constraint) {
  constexpr const ContactTree<C>& tree = kContactTree<C>;
  constexpr int nv = C::Robot::nv;
  for (int c = 0; c < C::n; ++c) {
    if (!contact_active(active, c)) continue;
    const int first = tree.first[c], rows = tree.rows[c], n = tree.path_n[c];
    const int* const dof = tree.path[c];
    S dTq[ContactData<C, S>::np][6], dTv[ContactData<C, S>::np][6];
    constraint(c, dTq, dTv);
    for (int m = 0; m < nv; ++m) {
      const bool moves = tree.moves(m, c);
      const int reach = moves ? n : tree.shared[c][m], a_m = tree.shared[c][m] - 1;
      S bq[6], bv[6];
      for (int r = 0; r < rows; ++r) {
        bq[r] = moves ? -dTq[a_m][r] : S(0.0);
        bv[r] = moves ? -dTv[a_m][r] : S(0.0);
      }
      for (int a = 0; a < reach; ++a) {
        const S xq = out.Xq(dof[a], m), xv = out.Xv(dof[a], m);
        for (int r = 0; r < rows; ++r) {
          bq[r] = madd(cd.U[c][a][r], xq, bq[r]);
          bv[r] = madd(cd.U[c][a][r], xv, bv[r]);
        }
      }
      for (int r = 0; r < rows; ++r) {
        out.Bq[first + r][m] = bq[r];
        out.Bv[first + r][m] = bv[r];
      }
    }
    for (int m = 0; m < nu; ++m) {
      const int reach = u_dof[m] < 0 ? n : tree.shared[c][u_dof[m]];
      for (int r = 0; r < rows; ++r) {
        S b = 0.0;
        for (int a = 0; a < reach; ++a) b = madd(cd.U[c][a][r], out.Xu[dof[a]][m], b);
        out.Bu[first + r][m] = b;
      }
    }
  }
}

}  // namespace engram
#endif  // CONTROLLER_RBD_RBD_CONTACT_DERIVATIVES_H_
