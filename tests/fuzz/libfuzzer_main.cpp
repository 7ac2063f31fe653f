// libFuzzer's entry for one target, chosen at compile time by SWIFTLET_FUZZ_TARGET.

#include <cstdlib>
#include <cstring>

#include "tests/fuzz/fuzz_targets.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const swiftlet::fuzz::Target kRun = [] {
    for (const swiftlet::fuzz::NamedTarget& target : swiftlet::fuzz::targets()) {
      if (std::strcmp(target.name, SWIFTLET_FUZZ_TARGET) == 0) return target.run;
    }
    std::abort();
  }();
  kRun({reinterpret_cast<const char*>(data), size});
  return 0;
}
