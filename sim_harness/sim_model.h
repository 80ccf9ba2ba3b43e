// The robot and its world in MuJoCo, seen through the conventions of the messages (docs/architecture.md).
#ifndef ENGRAM_SIM_HARNESS_SIM_MODEL_H_
#define ENGRAM_SIM_HARNESS_SIM_MODEL_H_

#include <mujoco/mujoco.h>

#include <cstdint>
#include <string>

namespace engram::sim {

constexpr int kMaxDof = 64;  // entries of q, v and tau in the messages

// Sends MuJoCo's errors and warnings to stderr, prefixed with the program's name; an error exits with code 70. MuJoCo's own
// handler would wait for the Enter key.
void install_mujoco_handlers(const char* program);

struct Pose {
  double p[3];     // p_WH (m)
  double quat[4];  // R_WH as a unit quaternion x, y, z, w
};

// Distance of two poses: metres, and the angle in rad of R_a' R_b.
double position_error(const Pose& a, const Pose& b);
double rotation_error(const Pose& a, const Pose& b);

struct Model {
  static constexpr int kBase = 1;  // MuJoCo's number of the robot's first body
  mjModel* m = nullptr;
  mjData* d = nullptr;
  int nq = 0, nv = 0, nu = 0;
  int nthruster = 0;          // the first controls: propellers on sites of the base
  bool free_base = false;     // joint 0 is a free joint
  int hand_site = -1;         // site that is judged, or -1
  uint64_t robot_digest = 0;  // custom text "robot_digest" of the scene, 0 if it has none
  std::string formula;        // custom text "formula": what moves the robot in MuJoCo's place (sim_formula.h), or empty

  ~Model();
  Model() = default;
  Model(const Model&) = delete;
  Model& operator=(const Model&) = delete;

  // Loads an MJCF scene. Returns an empty string, or one line that says what is wrong and what to do.
  // A scene fits if its actuators are thrusters on sites, then one motor with gear 1 for each of the last dofs, in order.
  std::string load(const char* path);
  std::string select_hand(const char* site);  // the MJCF site that is judged; same return

  // State in the convention of state_t:  q = [p_WB, x y z w, joints],  v = [R_WB' v_lin, w_B, joints].
  void get_state(double* q, double* v) const;
  void set_state(const double* q, const double* v);
  // Thrusts, then forces of the last dofs, in the convention of command_t (equal to MuJoCo's actuators).
  void set_tau(const double* tau);

  // The rest needs positions of the current qpos (mj_step1 or mj_forward).
  Pose hand_pose() const;
  const double* com() const { return d->subtree_com + 3 * kBase; }         // of the robot (m)
  const double* base_position() const { return d->xpos + 3 * kBase; }      // m
  double tilt() const;     // rad, between the base's z and the vertical
  double heading() const;  // rad, of the base's x about the vertical
  // Deepest contact between a moving body and a body welded to the world: index into d->contact, -1 if there is none.
  int robot_world_contact() const;
  const char* geom_label(int geom) const;  // its name, else its body's
  double joint_excess() const;             // largest distance of a limited joint beyond its range (rad or m), 0 inside
  double torque_share() const;  // of the control just set: largest distance from the middle of its range, 1 at the limits
};

}  // namespace engram::sim

#endif  // ENGRAM_SIM_HARNESS_SIM_MODEL_H_
