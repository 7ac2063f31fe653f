#pragma once
// Counts what operator new gives, in the test program that links recording_allocations.cpp.

#include <cstdint>

namespace swiftlet::test {

std::uint64_t allocationCount();

}  // namespace swiftlet::test
