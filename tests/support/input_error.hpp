#pragma once
// The InputError that a call throws.

#include <catch2/catch.hpp>
#include <string>

#include "drivers/input/input_error.hpp"

namespace swiftlet::test {

/// The error that `call` throws; the test fails if it throws none.
template <typename Call>
InputError errorOf(const Call& call) {
  try {
    call();
  } catch (const InputError& error) {
    return error;
  }
  FAIL("no InputError");
  return {"", 0, "", "", ""};
}

/// what() of the error that `call` throws; empty if it throws none.
template <typename Call>
std::string messageOf(const Call& call) {
  try {
    call();
  } catch (const InputError& error) {
    return error.what();
  }
  return {};
}

}  // namespace swiftlet::test
