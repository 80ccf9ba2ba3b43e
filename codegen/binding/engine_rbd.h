#ifndef CODEGEN_BINDING_ENGINE_RBD_H_
#define CODEGEN_BINDING_ENGINE_RBD_H_

#include <nanobind/nanobind.h>

namespace engram::binding {

// Adds a submodule per robot.
void bind_robots(nanobind::module_& engine);

}  // namespace engram::binding
#endif  // CODEGEN_BINDING_ENGINE_RBD_H_
