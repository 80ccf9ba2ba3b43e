// The command line of engram-controller.
#ifndef CONTROLLER_IO_IO_SETTINGS_H_
#define CONTROLLER_IO_IO_SETTINGS_H_

#include "controller/engram.h"

#include <initializer_list>

namespace engram::io {

enum class Clock { kLockstep, kWall };

struct Settings {
  const engram_model* model = nullptr;
  engram_options options = {};
  const char* lcm_url = "udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4000000";
  Clock clock = Clock::kLockstep;
  const char* timing = "";  // CSV file, "": none
  const char* jumps = "";   // CSV file, "": none
  bool realtime = false;
};

// The models that a program holds; the first one is the default.
using Models = std::initializer_list<const engram_model*>;

// Reads the command line. False: the program shall end with *exit_code; what there is to say has been said.
bool read_settings(int argc, char** argv, const Models& models, Settings* settings, int* exit_code);

}  // namespace engram::io
#endif  // CONTROLLER_IO_IO_SETTINGS_H_
