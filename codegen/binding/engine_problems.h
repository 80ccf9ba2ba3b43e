#ifndef CODEGEN_BINDING_ENGINE_PROBLEMS_H_
#define CODEGEN_BINDING_ENGINE_PROBLEMS_H_

#include <nanobind/nanobind.h>

namespace engram::binding {

void bind_arm(nanobind::module_& engine);
void bind_reach(nanobind::module_& engine);
void bind_memory(nanobind::module_& engine);
void bind_tensor_train(nanobind::module_& engine);
void bind_tables(nanobind::module_& engine);
void bind_steps(nanobind::module_& engine);
void bind_step_memory(nanobind::module_& engine);
void bind_study(nanobind::module_& engine);

}  // namespace engram::binding
#endif  // CODEGEN_BINDING_ENGINE_PROBLEMS_H_
