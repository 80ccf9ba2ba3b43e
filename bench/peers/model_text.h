// Reads a robot model written by export_models.py: no URDF parser, no serialization library on the peer's side.
#ifndef BENCH_PEERS_MODEL_TEXT_H_
#define BENCH_PEERS_MODEL_TEXT_H_

#include <fstream>
#include <pinocchio/multibody.hpp>
#include <stdexcept>
#include <string>

namespace bench {

struct RobotModel {
  pinocchio::Model model;
  Eigen::VectorXd q_ref;  // reference posture
};

namespace model_text {

// Row-major, as the file is.
template <class Matrix> inline Matrix read(std::istream& in) {
  Matrix m;
  for (int i = 0; i < m.rows(); ++i)
    for (int j = 0; j < m.cols(); ++j) in >> m(i, j);
  return m;
}

inline pinocchio::SE3 read_placement(std::istream& in) {
  const Eigen::Matrix3d R = read<Eigen::Matrix3d>(in);
  return pinocchio::SE3(R, read<Eigen::Vector3d>(in));
}

inline pinocchio::JointModel joint_model(const std::string& type, const Eigen::Vector3d& axis) {
  using namespace pinocchio;
  if (type == "JointModelFreeFlyer") return JointModelFreeFlyer();
  if (type == "JointModelRX") return JointModelRX();
  if (type == "JointModelRY") return JointModelRY();
  if (type == "JointModelRZ") return JointModelRZ();
  if (type == "JointModelPX") return JointModelPX();
  if (type == "JointModelPY") return JointModelPY();
  if (type == "JointModelPZ") return JointModelPZ();
  if (type == "JointModelRevoluteUnaligned") return JointModelRevoluteUnaligned(axis);
  if (type == "JointModelPrismaticUnaligned") return JointModelPrismaticUnaligned(axis);
  throw std::runtime_error("unknown joint type " + type);
}

}  // namespace model_text

inline RobotModel read_model(const std::string& path) {
  using namespace pinocchio;
  std::ifstream in(path);
  if (!in) throw std::runtime_error("cannot read " + path);
  RobotModel robot;
  Model& model = robot.model;
  int nq, nv, njoint, nframe;
  in >> model.name >> nq >> nv >> njoint;
  for (int i = 0; i < njoint; ++i) {
    std::string name, type;
    JointIndex parent;
    in >> name >> parent >> type;
    const Eigen::Vector3d axis = model_text::read<Eigen::Vector3d>(in);
    const SE3 placement = model_text::read_placement(in);
    double mass;
    in >> mass;
    const Eigen::Vector3d com = model_text::read<Eigen::Vector3d>(in);
    const Eigen::Matrix3d inertia = model_text::read<Eigen::Matrix3d>(in);
    const JointIndex joint = model.addJoint(parent, model_text::joint_model(type, axis), placement, name);
    model.inertias[joint] = Inertia(mass, com, Symmetric3(inertia));
  }
  in >> nframe;
  for (int i = 0; i < nframe; ++i) {
    std::string name;
    JointIndex parent;
    int type;
    in >> name >> parent >> type;
    model.addFrame(Frame(name, parent, 0, model_text::read_placement(in), FrameType(type)), false);
  }
  if (model.nq != nq || model.nv != nv) throw std::runtime_error(path + ": sizes do not match the joints");
  robot.q_ref.resize(nq);
  const auto read_vector = [&in](auto&& vector) {
    for (int i = 0; i < vector.size(); ++i) in >> vector[i];
  };
  read_vector(model.lowerPositionLimit);
  read_vector(model.upperPositionLimit);
  read_vector(model.upperVelocityLimit);
  read_vector(model.upperEffortLimit);
  read_vector(robot.q_ref);
  read_vector(model.armature);
  model.lowerVelocityLimit = -model.upperVelocityLimit;
  model.lowerEffortLimit = -model.upperEffortLimit;
  if (!in) throw std::runtime_error(path + ": truncated");
  return robot;
}

}  // namespace bench
#endif  // BENCH_PEERS_MODEL_TEXT_H_
