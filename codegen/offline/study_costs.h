// The costs of the studies by name. Arms are compiled each in its own file.
#ifndef CODEGEN_OFFLINE_STUDY_COSTS_H_
#define CODEGEN_OFFLINE_STUDY_COSTS_H_

#include "codegen/offline/study_cost.h"

#include <memory>
#include <string>

namespace engram::offline {

// Panda among table, box and shelf: "ik", "reach", "pick". Null if there is no such cost.
std::unique_ptr<StudyCost> panda_cost(const std::string& what);

}  // namespace engram::offline
#endif  // CODEGEN_OFFLINE_STUDY_COSTS_H_
