#pragma once
// One entry per reader of untrusted text or bytes. A target takes any bytes and returns: InputError is
// an answer, everything else that escapes (or a sanitizer's report) is a defect.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

namespace swiftlet::fuzz {

using Target = void (*)(std::string_view text);

struct NamedTarget {
  const char* name;  ///< also the folder of its corpus
  Target run;
};

std::span<const NamedTarget> targets();

}  // namespace swiftlet::fuzz
