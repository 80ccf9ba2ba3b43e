#include "sim_harness/render_scene.h"

#include <algorithm>
#include <cmath>

namespace engram::sim {
namespace {

constexpr int kMaxGeoms = 4000;
constexpr float kPlanFrom[4] = {1.00f, 0.60f, 0.05f, 0.95f}, kPlanTo[4] = {1.00f, 0.35f, 0.05f, 0.55f};
constexpr float kTrailFrom[4] = {0.15f, 0.45f, 0.95f, 0.10f}, kTrailTo[4] = {0.15f, 0.45f, 0.95f, 0.90f};

}  // namespace

Scene::~Scene() {
  if (!osmesa_) return;
  mjr_freeContext(&context_);
  mjv_freeScene(&scene_);
  OSMesaDestroyContext(osmesa_);
}

std::string Scene::open(const char* scene, const char* camera, const char* hand, int width, int height) {
  width_ = width, height_ = height;
  std::string wrong = model_.load(scene);
  if (wrong.empty()) wrong = model_.select_hand(hand);
  if (!wrong.empty()) return wrong;
  model_.m->vis.global.offwidth = width;
  model_.m->vis.global.offheight = height;
  model_.m->vis.quality.offsamples = 0;  // software rendering: samples are too dear

  osmesa_ = OSMesaCreateContextExt(GL_RGBA, 24, 8, 8, nullptr);
  surface_.resize(static_cast<size_t>(4) * width * height);
  pixels_.resize(static_cast<size_t>(3) * width * height);
  if (!osmesa_ || !OSMesaMakeCurrent(osmesa_, surface_.data(), GL_UNSIGNED_BYTE, width, height)) {
    return "OSMesa gives no off-screen context; install libosmesa6";
  }
  mjv_defaultOption(&option_);
  option_.geomgroup[3] = 0;  // collision geoms
  mjv_defaultCamera(&camera_);
  camera_.fixedcamid = mj_name2id(model_.m, mjOBJ_CAMERA, camera);
  if (camera_.fixedcamid >= 0) {
    camera_.type = mjCAMERA_FIXED;
  } else if (model_.free_base) {  // goes along with the robot
    follows_ = true;
    const double height = model_.m->key_qpos ? model_.m->key_qpos[2] : 0.5;
    camera_.lookat[2] = 0.6 * height;
    camera_.distance = 1.2 + 1.9 * height, camera_.azimuth = 140, camera_.elevation = -14;
  } else {
    camera_.lookat[0] = 0.35, camera_.lookat[1] = 0, camera_.lookat[2] = 0.4;
    camera_.distance = 2.0, camera_.azimuth = 150, camera_.elevation = -20;
  }
  mjv_defaultScene(&scene_);
  mjv_makeScene(model_.m, &scene_, kMaxGeoms);
  scene_.flags[mjRND_SHADOW] = 0;
  scene_.flags[mjRND_REFLECTION] = 0;
  mjr_defaultContext(&context_);
  mjr_makeContext(model_.m, &context_, mjFONTSCALE_150);
  mjr_setBuffer(mjFB_OFFSCREEN, &context_);
  if (context_.currentBuffer != mjFB_OFFSCREEN) return "MuJoCo gives no off-screen buffer under OSMesa";
  return "";
}

Point Scene::pose(const std::vector<double>& q) {
  const double rest[kMaxDof] = {};
  if (static_cast<int>(q.size()) == model_.nq) model_.set_state(q.data(), rest);
  mj_kinematics(model_.m, model_.d);
  mj_camlight(model_.m, model_.d);
  const Pose hand = model_.hand_pose();
  return {hand.p[0], hand.p[1], hand.p[2]};
}

void Scene::add_line(const std::vector<Point>& points, double width, const float* rgba_from, const float* rgba_to) {
  for (size_t i = 1; i < points.size() && scene_.ngeom < scene_.maxgeom; ++i) {
    const Point &a = points[i - 1], &b = points[i];
    if (std::max({std::abs(a[0] - b[0]), std::abs(a[1] - b[1]), std::abs(a[2] - b[2])}) < 5e-4) continue;  // too short to see
    const float s = static_cast<float>(i) / static_cast<float>(points.size());
    float rgba[4];
    for (int c = 0; c < 4; ++c) rgba[c] = (1 - s) * rgba_from[c] + s * rgba_to[c];
    mjvGeom* geom = scene_.geoms + scene_.ngeom++;
    mjv_initGeom(geom, mjGEOM_CAPSULE, nullptr, nullptr, nullptr, rgba);
    mjv_makeConnector(geom, mjGEOM_CAPSULE, width, a[0], a[1], a[2], b[0], b[1], b[2]);
  }
}

// three arrows along the target's axes
void Scene::add_target(const std::vector<double>& target) {
  if (target.size() < 7 || scene_.ngeom + 3 > scene_.maxgeom) return;
  const double quat[4] = {target[6], target[3], target[4], target[5]};
  constexpr float kAxes[3][4] = {{0.9f, 0.2f, 0.2f, 1}, {0.2f, 0.75f, 0.2f, 1}, {0.2f, 0.4f, 1.0f, 1}};
  for (int axis = 0; axis < 3; ++axis) {
    double along[3] = {};
    along[axis] = 0.12;
    mju_rotVecQuat(along, along, quat);
    mjvGeom* geom = scene_.geoms + scene_.ngeom++;
    mjv_initGeom(geom, mjGEOM_ARROW, nullptr, nullptr, nullptr, kAxes[axis]);
    mjv_makeConnector(geom, mjGEOM_ARROW, 0.008, target[0], target[1], target[2], target[0] + along[0], target[1] + along[1],
                      target[2] + along[2]);
    geom->emission = 0.4f;
  }
}

void Scene::caption(const mjrRect& rect, const Panel& panel) {
  const auto label = [&](int left, int bottom, int width, const std::string& text, const float* rgb) {
    if (!text.empty()) {
      const mjrRect box{rect.left + left, rect.bottom + bottom, width, 30};
      mjr_label(box, mjFONT_NORMAL, text.c_str(), rgb[0], rgb[1], rgb[2], 0.85f, 1, 1, 1, &context_);
    }
  };
  constexpr float kInk[3] = {0.13f, 0.16f, 0.20f};
  constexpr float kState[3][3] = {{0.35f, 0.38f, 0.42f}, {0.10f, 0.55f, 0.25f}, {0.78f, 0.16f, 0.14f}};
  label(10, rect.height - 40, 190, panel.title, kInk);
  label(10, 10, std::max(190, 20 + 10 * static_cast<int>(panel.note.size())), panel.note, kInk);
  label(rect.width - 260, 10, 250, panel.outcome, kState[panel.state]);
}

void Scene::draw(const Panel& panel) {
  if (panel.q) pose(*panel.q);
  const int target = mj_name2id(model_.m, mjOBJ_BODY, "target");
  const int mocap = target >= 0 ? model_.m->body_mocapid[target] : -1;
  if (mocap >= 0 && panel.target) {  // p_WT and quaternion x y z w, or yaw; in a plane what the numbers `target_of` say
    const std::vector<double>& t = *panel.target;
    const int numeric = mj_name2id(model_.m, mjOBJ_NUMERIC, "target_of");
    const double in_order[4] = {0, 1, 2, 3}, *of = numeric < 0 ? in_order : model_.m->numeric_data + model_.m->numeric_adr[numeric];
    double p[4];
    for (int i = 0; i < 4; ++i) p[i] = of[i] >= 0 && of[i] < static_cast<double>(t.size()) ? t[static_cast<size_t>(of[i])] : 0.0;
    double quat[4] = {std::cos(0.5 * p[3]), 0, 0, std::sin(0.5 * p[3])};
    if (t.size() >= 7) quat[0] = t[6], quat[1] = t[3], quat[2] = t[4], quat[3] = t[5];
    mju_copy3(model_.d->mocap_pos + 3 * mocap, p);
    mju_copy4(model_.d->mocap_quat + 4 * mocap, quat);
    mj_kinematics(model_.m, model_.d);
  }
  if (follows_) mju_copy(camera_.lookat, model_.base_position(), 2);
  mjv_updateScene(model_.m, model_.d, &option_, nullptr, &camera_, mjCAT_ALL, &scene_);
  add_line(panel.trail, 0.005, kTrailFrom, kTrailTo);
  if (panel.plan) add_line(*panel.plan, 0.008, kPlanFrom, kPlanTo);
  if (panel.target && mocap < 0) add_target(*panel.target);
  mjr_render(panel.rect, &scene_, &context_);
  caption(panel.rect, panel);
}

const unsigned char* Scene::pixels() {
  mjr_readPixels(pixels_.data(), nullptr, {0, 0, width_, height_}, &context_);
  return pixels_.data();
}

}  // namespace engram::sim
