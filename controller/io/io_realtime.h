// What the operating system offers a control thread: its CPU clock, locked memory, real-time priority.
#ifndef CONTROLLER_IO_IO_REALTIME_H_
#define CONTROLLER_IO_IO_REALTIME_H_

namespace engram::io {

// CPU time of the calling thread, us.
double thread_cpu_us();

// Locks all memory and puts the calling thread under SCHED_FIFO. If refused: one message with the mend, and on it goes.
void go_realtime(int priority);

}  // namespace engram::io
#endif  // CONTROLLER_IO_IO_REALTIME_H_
