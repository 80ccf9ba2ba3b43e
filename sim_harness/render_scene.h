// Draws the robot, its target, its plan and its past into an off-screen picture (OSMesa).
#ifndef ENGRAM_SIM_HARNESS_RENDER_SCENE_H_
#define ENGRAM_SIM_HARNESS_RENDER_SCENE_H_

#include <GL/osmesa.h>
#include <mujoco/mujoco.h>

#include <array>
#include <string>
#include <vector>

#include "sim_harness/sim_model.h"

namespace engram::sim {

using Point = std::array<double, 3>;

// One panel of the picture at one time.
struct Panel {
  mjrRect rect{};
  const std::vector<double>* q = nullptr;
  const std::vector<double>* target = nullptr;  // task vector: p_WT, and quaternion x y z w or yaw
  const std::vector<Point>* plan = nullptr;     // planned hand positions (m)
  std::vector<Point> trail;                     // where the hand was (m)
  std::string title, note, outcome;
  enum { kRunning, kSuccess, kFailure } state = kRunning;
};

class Scene {
 public:
  Scene() = default;
  Scene(const Scene&) = delete;
  Scene& operator=(const Scene&) = delete;
  ~Scene();

  // Empty string, or one line that says what is wrong.
  std::string open(const char* scene, const char* camera, const char* hand, int width, int height);
  // Sets the posture and returns where the hand is (m).
  Point pose(const std::vector<double>& q);
  void draw(const Panel& panel);
  const unsigned char* pixels();  // RGB, rows from bottom to top

  const Model& model() const { return model_; }

 private:
  void add_line(const std::vector<Point>& points, double width, const float* rgba_from, const float* rgba_to);
  void add_target(const std::vector<double>& target);
  void caption(const mjrRect& rect, const Panel& panel);

  Model model_;
  mjvScene scene_{};
  mjvOption option_{};
  mjvCamera camera_{};
  mjrContext context_{};
  OSMesaContext osmesa_ = nullptr;
  bool follows_ = false;  // the camera goes along with the base
  int width_ = 0, height_ = 0;
  std::vector<unsigned char> surface_, pixels_;
};

}  // namespace engram::sim

#endif  // ENGRAM_SIM_HARNESS_RENDER_SCENE_H_
