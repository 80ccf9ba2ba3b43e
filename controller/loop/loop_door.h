// Behind the door: what an engram_model points to.
#ifndef CONTROLLER_LOOP_LOOP_DOOR_H_
#define CONTROLLER_LOOP_LOOP_DOOR_H_

#include "controller/engram.h"

// The head of every controller; fast side and planner follow in the same block.
struct alignas(ENGRAM_ALIGN) engram_controller {
  const engram_model* model;
  engram_options options;
};

struct engram_model {
  engram_description about;
  size_t bytes;         // of the controller
  int32_t iterations;   // FDDP iterations per period by default
  bool (*tables_fit)();
  uint64_t (*table_digest)();
  engram_controller* (*build)(const engram_model*, const engram_options&, void* at);
  engram_status (*set_task)(engram_controller*, int64_t, int32_t, const double*, int);
  engram_status (*prepare)(engram_controller*, int64_t);
  engram_status (*feedback)(engram_controller*, int64_t, const double*, const double*);
  engram_status (*command)(engram_controller*, int64_t, const double*, const double*, double*);
  const engram_cycle& (*cycle)(const engram_controller*);
  const engram_jump& (*jump)(const engram_controller*);
  int32_t (*plan)(const engram_controller*, int64_t*, double*, double*, double*);
  int32_t (*choose_goal)(engram_controller*, const double*, const double*, const double*, int32_t, double*);  // NULL: it cannot
};

#endif  // CONTROLLER_LOOP_LOOP_DOOR_H_
