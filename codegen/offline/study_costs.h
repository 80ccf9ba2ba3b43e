// The costs of the studies by name. Every robot is compiled in a file of its own.
#ifndef CODEGEN_OFFLINE_STUDY_COSTS_H_
#define CODEGEN_OFFLINE_STUDY_COSTS_H_

#include "codegen/offline/study_arm.h"
#include "codegen/offline/study_cost.h"

#include <memory>
#include <stdexcept>
#include <string>

namespace engram::offline {

// Two postures that a transfer joins.
struct Ends {
  std::vector<double> from, to;
};

// Null if there is no cost of this name.
std::unique_ptr<StudyCost> panda_cost(const std::string& what, const Ends& ends);   // among table, box, shelf: ik, pose, reach, pick, transfer
std::unique_ptr<StudyCost> ur10_cost(const std::string& what);                      // free space, tool upright: ik
std::unique_ptr<StudyCost> planar_cost(const std::string& robot, const std::string& what, const Ends& ends);  // among discs: ik, reach, transfer

// controller/ik on the postures of m points x (m, 3 + nq) of the arm's "ik" cost, in place: to the target, blind to obstacles.
void panda_ik(double* x, std::size_t m, int iterations);
void ur10_ik(double* x, std::size_t m, int iterations);

template <class M> std::unique_ptr<StudyCost> transfer_cost(const Ends& ends) {
  using F = TransferCost<M>;
  F f{};
  if (ends.from.size() != f.from.size() || ends.to.size() != f.to.size()) throw std::invalid_argument("a transfer needs two postures");
  std::copy(ends.from.begin(), ends.from.end(), f.from.begin());
  std::copy(ends.to.begin(), ends.to.end(), f.to.begin());
  auto cost = std::make_unique<StudyCostOf<F, Pack>>(f);
  append_joints<typename M::Robot>(0, 1, cost->lo, cost->hi);
  return cost;
}

}  // namespace engram::offline
#endif  // CODEGEN_OFFLINE_STUDY_COSTS_H_
