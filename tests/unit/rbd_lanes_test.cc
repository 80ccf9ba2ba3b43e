// A lane of Pack computes, bit for bit, what the scalar computes (but for the sign of a zero).
#include <gtest/gtest.h>

#include "controller/rbd/rbd_aba.h"
#include "controller/rbd/rbd_derivatives.h"
#include "controller/rbd/rbd_frames.h"
#include "controller/rbd/rbd_manifold.h"
#include "tests/unit/rbd_test_robots.h"

namespace engram::test {
namespace {

// Everything the room computes from (q, v, u), in one flat list.
template <class R, class S> struct Outcome {
  static constexpr int nv = R::nv, kSize = R::nq + 5 * nv + 5 * nv * nv + 6 * nv + 4 * 36;
  S list[kSize];
  int size = 0;

  template <int n> void append(const S (&x)[n]) {
    for (const S& s : x) list[size++] = s;
  }
  template <int m, int n> void append(const Mat<S, m, n>& x) {
    for (int i = 0; i < m * n; ++i) list[size++] = x.data()[i];
  }

  void compute(const S* q, const S* v, const S* u) {
    static RbdData<R, S> d;
    static Mat<S, nv, nv> M, da_dq, da_dv, Minv, dg_dq;
    S inverse[nv], aba[nv], forward[nv], gravity[nv], q_next[R::nq], difference[nv];
    rbd_rnea<R>(q, v, u, d, inverse);
    rbd_aba<R>(q, v, u, d, aba);
    rbd_crba<R>(d, M);
    rbd_forward_dynamics<R>(q, v, u, d, forward);
    rbd_forward_derivatives<R>(d, forward, da_dq, da_dv, Minv);
    rbd_gravity<R>(d, gravity);
    rbd_gravity_derivatives<R>(d, dg_dq);
    rbd_integrate<R>(q, v, q_next);
    rbd_difference<R>(q, q_next, difference);
    append(inverse), append(aba), append(forward), append(gravity), append(q_next), append(difference);
    append(M), append(da_dq), append(da_dv), append(Minv), append(dg_dq);

    Mat3<S> R_WF;
    Vec3<S> p_WF;
    Mat<S, 6, nv> J;
    rbd_frame_placement<R>(d, 0, R_WF, p_WF);
    rbd_frame_jacobian_local<R>(d, 0, R_WF, p_WF, J);
    append(J);
    if constexpr (has_free_base<R>()) {
      Mat<S, 6, 6> E, G, J0, J1;
      rbd_integrate_jacobians(v, E, G);
      rbd_difference_jacobians(q, q_next, J0, J1);
      append(E), append(G), append(J0), append(J1);
    }
  }
};

template <class R> class Lanes : public ::testing::Test {};
TYPED_TEST_SUITE(Lanes, AllRobots);

TYPED_TEST(Lanes, EqualTheScalarBitForBit) {
  using R = TypeParam;
  Random random(3);
  Pack q[R::nq], v[R::nv], u[R::nv];
  for (int l = 0; l < kLanes; ++l) {
    const Vec<double, R::nq> ql = random.configuration<R>();
    for (int i = 0; i < R::nq; ++i) q[i].set(l, ql[i]);
    for (int i = 0; i < R::nv; ++i) {
      v[i].set(l, random());
      u[i].set(l, 10 * random());
    }
  }
  static Outcome<R, Pack> packed;  // static: large
  packed.compute(q, v, u);
  for (int l = 0; l < kLanes; ++l) {
    static Outcome<R, double> scalar;
    scalar.size = 0;
    scalar.compute(lane_of<R::nq>(q, l).data(), lane_of<R::nv>(v, l).data(), lane_of<R::nv>(u, l).data());
    ASSERT_EQ(scalar.size, packed.size);
    int different = 0;
    for (int i = 0; i < scalar.size; ++i) different += !(scalar.list[i] == packed.list[i][l]);
    EXPECT_EQ(different, 0) << "lane " << l << " of " << kLanes << ", out of " << scalar.size << " numbers";
  }
}

}  // namespace
}  // namespace engram::test
