// Two controllers must never steer one robot. Whoever starts asks on ENGRAM_PRESENCE and listens for a while; whoever serves answers.
// The newcomer leaves if it hears an answer, a command, or another newcomer that was there first.
#ifndef CONTROLLER_IO_IO_PRESENCE_H_
#define CONTROLLER_IO_IO_PRESENCE_H_

#include "controller/io/io_message.h"
#include "controller/io/io_outbox.h"

namespace engram::io {

class Presence {
 public:
  Presence(int64_t id, Sender sender) : sender_(sender) { mine_.id = id; }

  void ask() { say(); }
  void serve() { mine_.serving = 1; }
  bool serving() const { return mine_.serving == 1; }
  // True once there is somebody else: leave.
  bool taken() const { return taken_; }

  void on_presence(const void* bytes, uint32_t size);
  void on_command() { taken_ = taken_ || !serving(); }  // before we serve, every command is somebody else's

 private:
  bool say();

  Sender sender_;
  engram_msg_presence_t mine_ = {};
  bool taken_ = false;
};

}  // namespace engram::io
#endif  // CONTROLLER_IO_IO_PRESENCE_H_
