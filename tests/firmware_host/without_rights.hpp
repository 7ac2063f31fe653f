#pragma once
// The rights to real-time priorities and locked memory taken from the calling thread, and from threads that
// it makes, for a scope: a test run as root then sees what other users see. Where they are missing anyway
// nothing changes.

#include <linux/capability.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>

namespace swiftlet {

class WithoutRights {
 public:
  WithoutRights() {
    if (syscall(SYS_capget, &header_, before_.data()) != 0) return;
    auto fewer = before_;
    fewer[0].effective &= ~(1U << CAP_SYS_NICE | 1U << CAP_IPC_LOCK);
    taken_ = syscall(SYS_capset, &header_, fewer.data()) == 0;
    getrlimit(RLIMIT_RTPRIO, &priority_);
    const rlimit none{0, priority_.rlim_max};
    setrlimit(RLIMIT_RTPRIO, &none);
  }
  ~WithoutRights() {
    if (!taken_) return;
    syscall(SYS_capset, &header_, before_.data());
    setrlimit(RLIMIT_RTPRIO, &priority_);
  }
  WithoutRights(const WithoutRights&) = delete;
  WithoutRights& operator=(const WithoutRights&) = delete;

 private:
  __user_cap_header_struct header_{_LINUX_CAPABILITY_VERSION_3, 0};
  std::array<__user_cap_data_struct, _LINUX_CAPABILITY_U32S_3> before_{};
  rlimit priority_{};
  bool taken_ = false;
};

}  // namespace swiftlet
