// Side files of a run, as CSV: the CPU time of every cycle (--timing), and every jump with the merit of its guess and after each
// iteration (--jumps), from which the distance to the best known solution is computed offline.
#ifndef CONTROLLER_IO_IO_NOTES_H_
#define CONTROLLER_IO_IO_NOTES_H_

#include <cstdio>

#include "controller/engram.h"
#include "controller/io/io_report.h"

namespace engram::io {

class Notes {
 public:
  explicit Notes(Report* report) : report_(report) {}
  ~Notes() { close(); }
  Notes(const Notes&) = delete;
  Notes& operator=(const Notes&) = delete;

  // Opens a side file and writes its header; false with a message if that fails. NULL or "": none wanted.
  bool open_timing(const char* path);
  bool open_jumps(const char* path, const engram_description& about);

  // After engram_feedback: one row of timing; one row of the jump if this cycle was the first after it.
  void cycle(const engram_controller* controller, const engram_cycle& cycle);
  void close();

 private:
  // Static buffers: writing must not allocate.
  struct File {
    std::FILE* file = nullptr;
    char buffer[1 << 15];
  };
  bool open(File* file, const char* path);
  void check(File* file, const engram_cycle& cycle);

  Report* report_;
  File timing_, jumps_;
  engram_jump jump_ = {};
};

}  // namespace engram::io
#endif  // CONTROLLER_IO_IO_NOTES_H_
