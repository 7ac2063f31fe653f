#include "firmware_host/outputs/view/raised_niceness.hpp"

#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

namespace swiftlet {

void yieldToOthers() {
  constexpr int kNice = 10;
  // Of this thread alone, as Linux has it; a refusal leaves it as it is.
  static_cast<void>(setpriority(PRIO_PROCESS, static_cast<id_t>(syscall(SYS_gettid)), kNice));
}

}  // namespace swiftlet
