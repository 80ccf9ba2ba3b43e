// The memory of reaching around a pole: how the arm went on, in runs of this controller, from where it is now to such a target.
//
//   query   features (where hand and elbow are, how the hand moves, where it shall go) -> k-NN -> PCA -> paths of torso and arm over the horizon
//   warp    the path begins at the measured posture and velocity: q(t) = q_m(t) + (e + (e' + 2 e / kFade) t) (1 - t / kFade)^2,
//           e = q_0 - q_m(0), e' its rate
//   guess   all else (legs, base, the other arm) as in the shifted plan; torques by inverse dynamics on both feet
#ifndef CONTROLLER_LOOP_LOOP_POLE_MEMORY_H_
#define CONTROLLER_LOOP_LOOP_POLE_MEMORY_H_

#include "controller/loop/loop_rival.h"
#include "controller/ocp/ocp_stance.h"
#include "controller/tab/tab_knn.h"
#include "controller/tab/tab_pca.h"

namespace engram {

// Tables: knn (features -> coefficients), path (coefficients -> kKnots rows of C::nmoved joints, kKnotUs apart).
struct PoleTables {
  const TabKnn* knn;
  const TabPca* path;
};

inline constexpr int kPoleFeatures = 12;   // p_WH, p_WE [m], v_WH [m/s], p_WT [m]: hand, elbow, target; world axes
inline constexpr int kPoleMaxPath = 512;   // numbers of a path

// C: a configuration (loop_talos_pole.h) with `moved[nmoved]`, the driven dofs of the path, hand(x, p) and arm(x, p_WH, p_WE, v_WH).
template <class C, class P, const PoleTables& tables> class PoleMemory {
 public:
  static constexpr bool kRemembers = true, kContinues = false;
  static constexpr int kIterations = 3, kPatience = 10, kWays = 3;  // of a rival (loop_rival.h); neighbours offered in turn
  static constexpr int nq = P::nq, nv = P::nv, nu = P::nu, nmoved = C::nmoved;

  static bool tables_fit() {
    char text[TAB_TEXT];
    using R = typename P::R;
    return tab_check(&tables.knn->head, kTabKnn, R::digest, C::Task::digest, text) == kTabOk &&
           tab_check(&tables.path->head, kTabPca, R::digest, C::Task::digest, text) == kTabOk && tables.knn->d == kPoleFeatures &&
           tables.knn->m == tables.path->m && tables.path->n % nmoved == 0 && tab_pad(tables.path->n) <= kPoleMaxPath;
  }
  static uint64_t table_digest() { return (tables.knn->head.digest ^ tables.path->head.digest) * 0x100000001b3; }

  // The hand is where it shall be.
  template <class Target> static bool arrived(const Target& target, const double* x0) {
    using Task = typename C::Task;
    double p[3], away2 = 0.0;
    C::hand(x0, p);
    for (int i = 0; i < 3; ++i) away2 += (p[i] - target.hand[i]) * (p[i] - target.hand[i]);
    return away2 < Task::success_position * Task::success_position;
  }

  template <class Target, int N> bool guess(const Target& target, int64_t seq, const Plan<P, N>& shifted, Seed<P, N>& seed) {
    const double* const x0 = shifted.s.x[0];
    double feature[kPoleFeatures];
    C::arm(x0, feature, feature + 3, feature + 6);
    for (int i = 0; i < 3; ++i) feature[9 + i] = target.hand[i];
    int32_t index[kWays];
    float distance2[kWays];
    tab_knn_query(tables.knn, feature, kWays, index, distance2);
    const auto way = static_cast<int>(seq % kWays);
    if (index[way] < 0) return false;
    tab_pca_decode(tables.path, tab_knn_value(tables.knn, index[way]), path_);

    std::memcpy(seed.x, shifted.s.x, sizeof seed.x);
    double e[nmoved], slope[nmoved];
    for (int j = 0; j < nmoved; ++j) {
      e[j] = x0[joint(j)] - static_cast<double>(path_[j]);
      slope[j] = x0[velocity(j)] - (at(j, kKnot) - at(j, 0.0)) / kKnot + 2.0 / kFade * e[j];
    }
    for (int k = 0; k < N; ++k) {
      const double dt = shifted.dt(k), t = 1e-6 * static_cast<double>(shifted.utime[k + 1] - shifted.utime[0]);
      const double fade = std::fmax(0.0, 1.0 - t / kFade);
      for (int j = 0; j < nmoved; ++j) {
        const int q = joint(j), v = velocity(j);
        seed.x[k + 1][q] = at(j, t) + (e[j] + slope[j] * t) * fade * fade;
        seed.x[k + 1][v] = (seed.x[k + 1][q] - seed.x[k][q]) / dt;
      }
      double a[nv];
      for (int i = 0; i < nv; ++i) a[i] = (seed.x[k + 1][nq + i] - seed.x[k][nq + i]) / dt;
      inverse_dynamics_on_contacts<P>(seed.x[k], seed.x[k] + nq, a, kAllContacts, seed.u[k]);
    }
    return true;
  }

 private:
  static constexpr unsigned kAllContacts = (1u << P::Contacts::n) - 1u;
  static constexpr double kFade = 0.4, kKnot = C::Task::dt;  // s

  static constexpr int joint(int j) { return nq - nu + C::moved[j]; }
  static constexpr int velocity(int j) { return nq + nv - nu + C::moved[j]; }
  // The remembered angle of joint j at time t, linear between the path's knots; it rests at the end.
  double at(int j, double t) const {
    const int rows = tables.path->n / nmoved;
    const double s = std::fmin(t / kKnot, static_cast<double>(rows - 1));
    const int k = static_cast<int>(s) < rows - 2 ? static_cast<int>(s) : rows - 2;
    const double a = path_[k * nmoved + j], b = path_[(k + 1) * nmoved + j];
    return a + (s - k) * (b - a);
  }

  float path_[kPoleMaxPath];
};

}  // namespace engram
#endif  // CONTROLLER_LOOP_LOOP_POLE_MEMORY_H_
