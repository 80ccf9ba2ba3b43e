// Exit codes of engram-controller.
#ifndef CONTROLLER_IO_IO_EXIT_H_
#define CONTROLLER_IO_IO_EXIT_H_

namespace engram::io {

enum ExitCode : int { kExitOk = 0, kExitUsage = 64, kExitNetwork = 2, kExitTaken = 3 };

}  // namespace engram::io
#endif  // CONTROLLER_IO_IO_EXIT_H_
