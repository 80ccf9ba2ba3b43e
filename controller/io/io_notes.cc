#include "controller/io/io_notes.h"

#include <cerrno>
#include <cstring>
#include <initializer_list>

namespace engram::io {

bool Notes::open(File* file, const char* path) {
  if (path == nullptr || *path == '\0') return true;
  file->file = std::fopen(path, "w");
  if (file->file == nullptr) {
    std::fprintf(stderr, "engram-controller: cannot write %s: %s\n", path, std::strerror(errno));
    return false;
  }
  std::setvbuf(file->file, file->buffer, _IOFBF, sizeof file->buffer);
  return true;
}

bool Notes::open_timing(const char* path) {
  if (!open(&timing_, path)) return false;
  if (timing_.file) {
    std::fputs("utime,seq,jump,rung,iterations,query_us,candidates_us,linearize_us,backward_us,rollout_us,total_us\n",
               timing_.file);
  }
  return true;
}

bool Notes::open_jumps(const char* path, const engram_description& about) {
  if (!open(&jumps_, path)) return false;
  if (jumps_.file == nullptr) return true;
  std::fputs("jump,utime,winner", jumps_.file);
  for (int i = 0; i < about.nq + about.nv; ++i) std::fprintf(jumps_.file, ",x0_%d", i);
  for (int i = 0; i < about.ntask; ++i) std::fprintf(jumps_.file, ",task_%d", i);
  std::fputs(",merits\n", jumps_.file);  // as many columns as iterations, plus the guess
  return true;
}

void Notes::check(File* file, const engram_cycle& cycle) {
  if (!std::ferror(file->file)) return;
  report_->note(Trouble::kFile, cycle.utime, cycle.seq);
  std::fclose(file->file);
  file->file = nullptr;
}

void Notes::cycle(const engram_controller* controller, const engram_cycle& c) {
  if (timing_.file) {
    std::fprintf(timing_.file, "%lld,%lld,%d,%d,%d,%.1f,%.1f,%.1f,%.1f,%.1f,%.1f\n", static_cast<long long>(c.utime),
                 static_cast<long long>(c.seq), c.jump, c.rung, c.iterations, c.query_us, c.candidates_us, c.linearize_us,
                 c.backward_us, c.rollout_us, c.total_us);
    check(&timing_, c);
  }
  if (jumps_.file && c.jump != jump_.jump) {
    engram_jump_info(controller, &jump_);
    const engram_description& about = *engram_describe(engram_model_of(controller));
    std::fprintf(jumps_.file, "%d,%lld,%s", jump_.jump, static_cast<long long>(jump_.utime), engram_candidate_text(jump_.winner));
    for (int i = 0; i < about.nq + about.nv; ++i) std::fprintf(jumps_.file, ",%.17g", jump_.x0[i]);
    for (int i = 0; i < about.ntask; ++i) std::fprintf(jumps_.file, ",%.17g", jump_.task[i]);
    for (int i = 0; i <= jump_.niterations; ++i) std::fprintf(jumps_.file, ",%.17g", jump_.merit[i]);
    std::fputc('\n', jumps_.file);
    check(&jumps_, c);
  }
}

void Notes::close() {
  for (File* f : {&timing_, &jumps_}) {
    if (f->file == nullptr) continue;
    if (std::fclose(f->file) != 0) report_->note(Trouble::kFile, 0, 0);
    f->file = nullptr;
  }
}

}  // namespace engram::io
