// Rigid contacts: forward dynamics under the constraint that chosen frames do not accelerate.
//
//   M a + b = tau + J' lambda,    J a + a0 = 0,    a0 = (drift) + kd (velocity) + kp (placement error)
//
// lambda is the force of the ground on the robot, in world axes at the frame's origin: f for a point, (f, n) for a surface.
// With M = L' D L and U = D^-1 L^-T J' (nonzero on the contact's path to the root only):
//   y = L^-T (tau - b)    G = U' D U    lambda = -G^-1 (U' y + a0)    a = L^-1 (D^-1 y + U lambda)
// Source: Budhiraja, Carpentier, Mastalli, Mansard, Differential Dynamic Programming for Multi-Phase Rigid Contact Dynamics
// (Humanoids 2018); stabilization: Baumgarte (1972).
//
// A contact set C lists, at compile time, the frames that may touch, so that paths and sizes are constants; which of them do is a
// run-time mask, bit c for contact c:
//   struct C { using Robot; static constexpr int n; static constexpr int frame[n]; static constexpr ContactKind kind[n];
//              static constexpr double kp, kd; };    gains [1/s^2, 1/s]
#ifndef CONTROLLER_RBD_RBD_CONTACT_H_
#define CONTROLLER_RBD_RBD_CONTACT_H_

#include "controller/rbd/rbd_forward.h"
#include "controller/rbd/rbd_frames.h"
#include "controller/rbd/rbd_manifold.h"

#include <cmath>
#include <type_traits>

namespace engram {

// A point may rotate (3 rows: its classical acceleration); a surface may not (6 rows: its spatial acceleration).
enum class ContactKind : uint8_t { kPoint, kSurface };

// What the tree makes of a contact set: rows, paths, and what they share.
template <class C> struct ContactTree {
  using R = typename C::Robot;
  int rows[C::n] = {};       // of contact c
  int first[C::n + 1] = {};  // its first row among the rows of all contacts, active or not
  int joint[C::n] = {};
  int path_n[C::n] = {};  // dofs that move contact c, from the root outward
  int path[C::n][R::nv] = {};
  int shared[C::n][R::nv] = {};  // how many leading dofs of path c are dof k or move it

  constexpr ContactTree() {
    for (int c = 0; c < C::n; ++c) {
      rows[c] = C::kind[c] == ContactKind::kPoint ? 3 : 6;
      first[c + 1] = first[c] + rows[c];
      joint[c] = R::frame_joint[C::frame[c]];
      const int last = kTree<R>.last[joint[c]];
      for (int k = last; k >= 0; k = kTree<R>.parent[k]) ++path_n[c];
      for (int k = last, a = path_n[c]; k >= 0; k = kTree<R>.parent[k]) path[c][--a] = k;
      for (int k = 0; k < R::nv; ++k)
        while (shared[c][k] < path_n[c] && path[c][shared[c][k]] <= k && k < kTree<R>.end[path[c][shared[c][k]]]) ++shared[c][k];
    }
  }
  // True if dof k moves contact c.
  constexpr bool moves(int k, int c) const { return shared[c][k] > 0 && path[c][shared[c][k] - 1] == k; }
  constexpr int longest_path() const {
    int n = 0;
    for (int c = 0; c < C::n; ++c) n = path_n[c] > n ? path_n[c] : n;
    return n;
  }
};
template <class C> inline constexpr ContactTree<C> kContactTree{};

// Rows of all contacts of C.
template <class C> inline constexpr int kContactRows = kContactTree<C>.first[C::n];
constexpr bool contact_active(unsigned active, int c) { return (active >> c & 1u) != 0; }

// The rows of the active contacts, in order.
template <class C> struct ActiveRows {
  int n = 0;
  int row[kContactRows<C>] = {};
  explicit ActiveRows(unsigned active) {
    for (int c = 0; c < C::n; ++c) {
      for (int r = kContactTree<C>.first[c]; contact_active(active, c) && r < kContactTree<C>.first[c + 1]; ++r) row[n++] = r;
    }
  }
};

// The axes in which costs see the forces of a set: C::axes, or by default the world's, at the frame's origin (Crocoddyl's contacts of
// kind WORLD and LOCAL_WORLD_ALIGNED both are so). The dynamics is the same either way.
template <class C, class = void> inline constexpr Axes kContactAxes = Axes::kLocalWorldAligned;
template <class C> inline constexpr Axes kContactAxes<C, std::void_t<decltype(C::axes)>> = C::axes;

// Reference placements of the contacts, world axes; used if kp > 0.
template <class C, class S> struct ContactReference {
  S p[C::n][3];  // [m]
  S R[C::n][9];  // row-major
};

// Work space of the contacts of C over S. Entries of inactive contacts are left as they are, but lambda, which is 0 there.
template <class C, class S> struct ContactData {
  static constexpr int nf = kContactRows<C>, np = kContactTree<C>.longest_path();
  Mat3<S> R_WF[C::n];       // frame axes
  Vec3<S> p_WF[C::n];       // frame origin [m]
  Motion<S> J[C::n][np];    // column of path dof a: velocity of the origin and angular velocity, world axes
  S U[C::n][np][6];         // D^-1 L^-T J', row of path dof a
  S G[nf][nf];              // J M^-1 J', lower triangle, then its Cholesky factor
  S G_inv[nf];              // inverse diagonal of the factor
  S a0[nf];                 // drift
  S lambda[nf];             // contact forces [N, N m]
  Motion<S> error[C::n];    // placement error in world axes, if kp > 0: log6 of a surface, p - p_ref of a point
  Mat<S, 6, 6> Jlog[C::n];  // d log6 of a surface in frame axes, if kp > 0
};

// Placements and Jacobians of the active contacts. After rbd_kinematics.
template <class C, class R, class S>
inline void rbd_contact_jacobians(const RbdData<R, S>& d, unsigned active, ContactData<C, S>& cd) {
  constexpr const ContactTree<C>& tree = kContactTree<C>;
  for (int c = 0; c < C::n; ++c) {
    if (!contact_active(active, c)) continue;
    rbd_frame_placement<R>(d, C::frame[c], cd.R_WF[c], cd.p_WF[c]);
    for (int a = 0; a < tree.path_n[c]; ++a) cd.J[c][a] = moved_to(d.J[tree.path[c][a]], cd.p_WF[c]);
  }
}

// A pivot of G below this share of its diagonal entry is rounding: the contacts ask for the same motion twice, or for one that their
// paths cannot make.
inline constexpr Real kSingularContact = sizeof(Real) == sizeof(double) ? 1e-13 : 5e-5;  // 450 units of rounding

// cd.U and the Cholesky factor of cd.G. After rbd_factor and rbd_contact_jacobians. A singular set of contacts leaves NaN, from which
// the solver makes a status.
template <class C, class R, class S>
inline void rbd_contact_factor(const RbdData<R, S>& d, unsigned active, ContactData<C, S>& cd) {
  constexpr const ContactTree<C>& tree = kContactTree<C>;
  for (int c = 0; c < C::n; ++c) {
    if (!contact_active(active, c)) continue;
    const int n = tree.path_n[c], rows = tree.rows[c];
    const int* const dof = tree.path[c];
    S T[ContactData<C, S>::np][6];  // L^-T J'
    for (int a = 0; a < n; ++a)
      for (int r = 0; r < rows; ++r) T[a][r] = motion_entry(cd.J[c][a], r);
    for (int a = n - 1; a >= 0; --a)  // a path is a chain
      for (int b = a - 1; b >= 0; --b) {
        const S l = d.L(dof[a], dof[b]);
        for (int r = 0; r < rows; ++r) T[b][r] = nmadd(l, T[a][r], T[b][r]);
      }
    for (int a = 0; a < n; ++a)
      for (int r = 0; r < rows; ++r) cd.U[c][a][r] = T[a][r] * d.D_inv[dof[a]];
    for (int e = 0; e <= c; ++e) {  // G_ce over the dofs that the paths share
      if (!contact_active(active, e)) continue;
      const int common = tree.shared[e][dof[n - 1]];
      for (int r = 0; r < rows; ++r)
        for (int s = 0; s < (e == c ? r + 1 : tree.rows[e]); ++s) {
          S g = 0.0;
          for (int a = 0; a < common; ++a) g = madd(T[a][r], cd.U[e][a][s], g);
          cd.G[tree.first[c] + r][tree.first[e] + s] = g;
        }
    }
  }
  const ActiveRows<C> rows(active);
  for (int J = 0; J < rows.n; ++J) {
    const int j = rows.row[J];
    S diagonal = cd.G[j][j];
    const S least = S(kSingularContact) * diagonal;
    for (int K = 0; K < J; ++K) diagonal = nmadd(cd.G[j][rows.row[K]], cd.G[j][rows.row[K]], diagonal);
    cd.G_inv[j] = select(diagonal > least, 1.0 / sqrt(diagonal), S(NAN));
    for (int I = J + 1; I < rows.n; ++I) {
      const int i = rows.row[I];
      S g = cd.G[i][j];
      for (int K = 0; K < J; ++K) g = nmadd(cd.G[i][rows.row[K]], cd.G[j][rows.row[K]], g);
      cd.G[i][j] = g * cd.G_inv[j];
    }
  }
}

// lambda = -G^-1 (U' y + a0) for the active contacts, 0 for the others; then y += D U lambda. After rbd_contact_factor.
template <class C, class R, class S>
inline void rbd_contact_forces(const RbdData<R, S>& d, unsigned active, ContactData<C, S>& cd, S (&y)[R::nv]) {
  constexpr const ContactTree<C>& tree = kContactTree<C>;
  for (S& l : cd.lambda) l = 0.0;
  for (int c = 0; c < C::n; ++c) {
    if (!contact_active(active, c)) continue;
    for (int r = 0; r < tree.rows[c]; ++r) {
      S e = cd.a0[tree.first[c] + r];
      for (int a = 0; a < tree.path_n[c]; ++a) e = madd(cd.U[c][a][r], y[tree.path[c][a]], e);
      cd.lambda[tree.first[c] + r] = -e;
    }
  }
  const ActiveRows<C> rows(active);
  for (int I = 0; I < rows.n; ++I) {
    const int i = rows.row[I];
    for (int K = 0; K < I; ++K) cd.lambda[i] = nmadd(cd.G[i][rows.row[K]], cd.lambda[rows.row[K]], cd.lambda[i]);
    cd.lambda[i] *= cd.G_inv[i];
  }
  for (int I = rows.n - 1; I >= 0; --I) {
    const int i = rows.row[I];
    for (int K = I + 1; K < rows.n; ++K) cd.lambda[i] = nmadd(cd.G[rows.row[K]][i], cd.lambda[rows.row[K]], cd.lambda[i]);
    cd.lambda[i] *= cd.G_inv[i];
  }
  for (int k = 0; k < R::nv; ++k) y[k] *= d.D_inv[k];
  for (int c = 0; c < C::n; ++c) {
    if (!contact_active(active, c)) continue;
    for (int a = 0; a < tree.path_n[c]; ++a)
      for (int r = 0; r < tree.rows[c]; ++r)
        y[tree.path[c][a]] = madd(cd.U[c][a][r], cd.lambda[tree.first[c] + r], y[tree.path[c][a]]);
  }
}

// The forces of the active contacts in the axes of the set, l (nf). After rbd_contact_forces.
template <class C, class S> inline void rbd_contact_forces_seen(unsigned active, const ContactData<C, S>& cd, S* l) {
  constexpr const ContactTree<C>& tree = kContactTree<C>;
  for (int r = 0; r < kContactRows<C>; ++r) l[r] = cd.lambda[r];
  static_assert(kContactAxes<C> != Axes::kWorld, "forces act at the contact: kLocal or kLocalWorldAligned");
  if constexpr (kContactAxes<C> == Axes::kLocalWorldAligned) return;
  for (int c = 0; c < C::n; ++c) {
    if (!contact_active(active, c)) continue;
    for (S* part = l + tree.first[c]; part < l + tree.first[c + 1]; part += 3) {
      const Vec3<S> f = mul_transposed(cd.R_WF[c], Vec3<S>(part[0], part[1], part[2]));
      for (int i = 0; i < 3; ++i) part[i] = f[i];
    }
  }
}

// x := L^-T x and x := L^-1 x with the factor of rbd_factor.
template <class R, class S> inline void rbd_solve_upper(const RbdData<R, S>& d, S (&x)[R::nv]) {
  for (int k = R::nv - 1; k >= 0; --k)
    for (int j = kTree<R>.parent[k]; j >= 0; j = kTree<R>.parent[j]) x[j] = nmadd(d.L(k, j), x[k], x[j]);
}
template <class R, class S> inline void rbd_solve_lower(const RbdData<R, S>& d, S (&x)[R::nv]) {
  for (int k = 0; k < R::nv; ++k)
    for (int j = kTree<R>.parent[k]; j >= 0; j = kTree<R>.parent[j]) x[k] = nmadd(d.L(k, j), x[j], x[k]);
}

// cd.error (and cd.Jlog): how far the active contacts are from their references.
template <class C, class S>
inline void rbd_contact_errors(const ContactReference<C, S>& ref, unsigned active, ContactData<C, S>& cd) {
  for (int c = 0; c < C::n; ++c) {
    if (!contact_active(active, c)) continue;
    const Vec3<S> offset = cd.p_WF[c] - Vec3<S>(ref.p[c][0], ref.p[c][1], ref.p[c][2]);
    cd.error[c] = {offset, Vec3<S>::Zero()};
    if (C::kind[c] == ContactKind::kPoint) continue;
    Mat3<S> R_ref;
    for (int i = 0; i < 9; ++i) R_ref(i / 3, i % 3) = ref.R[c][i];
    const Mat3<S> R_e = matmul_transposed(R_ref, cd.R_WF[c]);
    const Vec3<S> p_e = mul_transposed(R_ref, offset);
    const Motion<S> e = log6(R_e, p_e);
    cd.error[c] = {mul(cd.R_WF[c], e.lin), mul(cd.R_WF[c], e.ang)};
    cd.Jlog[c] = jlog6(e.ang, p_e);
  }
}

// cd.a0: acceleration of the active contacts at zero joint acceleration, plus the stabilization. After rbd_body_forces(nullptr, d),
// rbd_contact_jacobians and, if kp > 0, rbd_contact_errors.
template <class C, class R, class S>
inline void rbd_contact_drift(const RbdData<R, S>& d, unsigned active, ContactData<C, S>& cd) {
  constexpr const ContactTree<C>& tree = kContactTree<C>;
  for (int c = 0; c < C::n; ++c) {
    if (!contact_active(active, c)) continue;
    const int i = tree.joint[c];
    const Motion<S> V = moved_to(d.V[i], cd.p_WF[c]);
    Motion<S> A = moved_to(d.A[i], cd.p_WF[c]);
    A.lin += constant3<S>(R::gravity);  // d.A is the acceleration minus gravity
    if (C::kind[c] == ContactKind::kPoint) A.lin = cross_add(V.ang, V.lin, A.lin);
    A = madd(V, S(C::kd), A);
    if constexpr (C::kp > 0.0) A = madd(cd.error[c], S(C::kp), A);
    for (int r = 0; r < tree.rows[c]; ++r) cd.a0[tree.first[c] + r] = motion_entry(A, r);
  }
}

// Joint accelerations a (nv) and contact forces cd.lambda for q (nq), v (nv), joint forces tau (nv) [N, N m]; ref may be null if kp = 0.
// Overwrites all of d (A and f with their values at zero joint acceleration) and cd. No heap.
template <class C, class R, class S> inline void rbd_contact_dynamics(const S* q, const S* v, const S* tau,
                                                                      const ContactReference<C, S>* ref, unsigned active,
                                                                      RbdData<R, S>& d, ContactData<C, S>& cd, S (&a)[R::nv]) {
  rbd_kinematics(q, d);
  rbd_velocity(v, d);
  rbd_inertias(d);
  rbd_body_forces<R, S>(nullptr, d);
  rbd_project_forces(d, a);
  for (int k = 0; k < R::nv; ++k) a[k] = tau[k] - a[k];
  rbd_composite_inertias(d);
  rbd_crba_lower(d, d.L);
  rbd_factor<R>(d.L, d.D_inv);
  rbd_contact_jacobians(d, active, cd);
  rbd_contact_factor(d, active, cd);
  if constexpr (C::kp > 0.0) rbd_contact_errors(*ref, active, cd);
  else static_cast<void>(ref);
  rbd_contact_drift(d, active, cd);
  rbd_solve_upper(d, a);
  rbd_contact_forces(d, active, cd, a);
  rbd_solve_lower(d, a);
}

}  // namespace engram
#endif  // CONTROLLER_RBD_RBD_CONTACT_H_
