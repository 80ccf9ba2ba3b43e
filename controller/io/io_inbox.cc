#include "controller/io/io_inbox.h"

namespace engram::io {
namespace {
constexpr int64_t kLatest = int64_t{1} << 52;  // us, more than a century: a later time is no time
}

bool Inbox::good(Decoded decoded) {
  if (decoded == Decoded::kGood) return true;
  report_->note(decoded == Decoded::kForeign ? Trouble::kForeign : Trouble::kSize, state_utime_, state_seq_);
  return false;
}

Verdict Inbox::state(const void* bytes, uint32_t size, engram_msg_state_t* state) {
  engram_msg_state_t heard;
  if (!good(read_message(bytes, size, &heard))) return Verdict::kIgnored;
  const auto refuse = [&](Trouble why) {
    report_->note(why, heard.utime, heard.seq);
    return Verdict::kIgnored;
  };
  if (static_cast<uint64_t>(heard.robot_digest) != about_.robot_digest) return refuse(Trouble::kRobotDigest);
  if (heard.nq != about_.nq || heard.nv != about_.nv) return refuse(Trouble::kShape);
  if (heard.seq < 1 || heard.utime < 0 || heard.utime > kLatest) return refuse(Trouble::kOutOfOrder);

  Verdict verdict = Verdict::kNew;
  if (heard.seq == state_seq_ && heard.utime == state_utime_) {
    report_->note(Trouble::kDuplicate, heard.utime, heard.seq);
    return Verdict::kDuplicate;
  }
  if (heard.seq == 1 && state_seq_ > 0) {
    report_->note(Trouble::kRestart, heard.utime, heard.seq);
    task_seq_ = 0;
    verdict = Verdict::kRestart;
  } else if (heard.seq <= state_seq_ || (state_seq_ > 0 && heard.utime <= state_utime_)) {
    return refuse(Trouble::kOutOfOrder);
  }
  state_seq_ = heard.seq;
  state_utime_ = heard.utime;
  *state = heard;
  return verdict;
}

Verdict Inbox::task(const void* bytes, uint32_t size, engram_msg_task_t* task) {
  engram_msg_task_t heard;
  if (!good(read_message(bytes, size, &heard))) return Verdict::kIgnored;
  const auto refuse = [&](Trouble why) {
    report_->note(why, heard.utime, heard.seq);
    return Verdict::kIgnored;
  };
  if (static_cast<uint64_t>(heard.task_digest) != about_.task_digest) return refuse(Trouble::kTaskDigest);
  if (heard.n != about_.ntask) return refuse(Trouble::kShape);
  if (heard.seq < 1 || heard.utime < 0 || heard.utime > kLatest) return refuse(Trouble::kOutOfOrder);
  if (heard.seq == task_seq_) return Verdict::kDuplicate;  // a sender may repeat its task for late listeners: not worth a word
  if (heard.seq < task_seq_) return refuse(Trouble::kOutOfOrder);
  task_seq_ = heard.seq;
  *task = heard;
  return Verdict::kNew;
}

}  // namespace engram::io
