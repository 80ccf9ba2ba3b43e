// engram._engine: the compiled controller in Python. Nothing is computed here twice; the module only hands arrays over.
#include "codegen/binding/engine_problems.h"
#include "codegen/binding/engine_rbd.h"

NB_MODULE(_engine, engine) {
  engine.doc() = "Compiled robots, optimal control problems and solvers of Engram.";
  engram::binding::bind_robots(engine);
  engram::binding::bind_arm(engine);
  engram::binding::bind_reach(engine);
  engram::binding::bind_steps(engine);
  engram::binding::bind_step_memory(engine);
  engram::binding::bind_memory(engine);
  engram::binding::bind_tensor_train(engine);
  engram::binding::bind_tables(engine);
  engram::binding::bind_study(engine);
}
