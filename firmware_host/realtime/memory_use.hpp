#pragma once
// Resident memory of this process, as the kernel counts it.

#include <cstdint>

namespace swiftlet {

std::int64_t residentBytes();      ///< now; 0: unknown
std::int64_t peakResidentBytes();  ///< highest so far

}  // namespace swiftlet
