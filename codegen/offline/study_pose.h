// Cost of a posture for a pose of the frame: what the train in an arm's memory is built from (controller/memory/memory_train.h).
#ifndef CODEGEN_OFFLINE_STUDY_POSE_H_
#define CODEGEN_OFFLINE_STUDY_POSE_H_

#include "codegen/offline/study_arm.h"
#include "controller/memory/memory_pose.h"

namespace engram::offline {

// x = (p [m], three angles [rad] as in memory_pose.h, q [rad]).
//   C = 1/3 (|p_WF - p| / 0.05 + (3 - tr(R' R_WF)) / 4 / 0.2 + C_obst / 0.01)        (thesis B.3, a whole pose for a target)
template <class M> struct PoseCost {
  using R = typename M::Robot;
  static constexpr int ntask = kMemoryPose, d = ntask + R::nq;

  template <class S> S operator()(const S* x, S* gradient) const {
    return gradient ? evaluate<true>(x, gradient) : evaluate<false>(x, gradient);
  }

 private:
  template <bool slopes, class S> static S evaluate(const S* x, S* gradient) {
    using Terms = ArmTerms<M, S, slopes>;
    constexpr double w_p = 1.0 / 3 / 0.05, w_R = 1.0 / 3 / 0.2, w_o = 1.0 / 3 / 0.01;
    constexpr int joint = R::frame_joint[M::frame];
    typename Terms::Posture posture(x + ntask);
    Mat3<S> R_WF;
    Vec3<S> p_WF, unit;
    rbd_frame_placement(posture.d, M::frame, R_WF, p_WF);
    const Mat3<S> R_WT = memory_pose_rotation(x + 3);
    S c = w_p * length<S>(p_WF - Vec3<S>(x[0], x[1], x[2]), unit), trace = 0.0;
    posture.push(joint, p_WF, unit * S(w_p));
    Vec3<S> moment = Vec3<S>::Zero();
    for (int j = 0; j < 3; ++j) {
      trace += dot<S>(R_WF.column(j), R_WT.column(j));
      moment += cross<S>(R_WF.column(j), R_WT.column(j));
    }
    c += (0.25 * w_R) * (3.0 - trace);
    posture.twist(joint, moment * S(-0.25 * w_R));
    c += Terms::obstacles(posture, w_o);
    if constexpr (slopes) {
      for (int k = 0; k < d; ++k) gradient[k] = 0.0;
      posture.add_gradient(gradient + ntask);
    }
    return c;
  }
};

}  // namespace engram::offline
#endif  // CODEGEN_OFFLINE_STUDY_POSE_H_
