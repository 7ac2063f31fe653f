#include "firmware_host/outputs/view/view_token.hpp"

#include <fmt/format.h>
#include <sys/random.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdlib>

#include "drivers/input/input_error.hpp"

namespace swiftlet {
namespace {

constexpr std::size_t kRandomBytes = 16;

std::string randomToken() {
  std::array<unsigned char, kRandomBytes> bytes{};
  // Requests of up to 256 bytes are always complete once the kernel has gathered entropy after boot.
  if (getrandom(bytes.data(), bytes.size(), 0) != static_cast<ssize_t>(bytes.size())) {
    throw InputError("--view", 0, "", "the kernel gives no random numbers for a token",
                     std::string("Set ") + kViewTokenVariable);
  }
  std::string text;
  for (const unsigned char byte : bytes) text += fmt::format("{:02x}", byte);
  return text;
}

bool isPlain(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_';
}

}  // namespace

std::string viewToken(const ViewAddress& address) {
  if (address.isLoopback()) return "";
  const char* own = std::getenv(kViewTokenVariable);
  if (own == nullptr) return randomToken();
  const std::string token = own;
  if (token.size() < kLeastToken || !std::ranges::all_of(token, isPlain)) {
    throw InputError(kViewTokenVariable, 0, "", "is not a usable token",
                     fmt::format("Set at least {} letters, digits, '-' or '_', or unset it", kLeastToken));
  }
  return token;
}

bool sameToken(std::string_view expected, std::string_view given) {
  // The token's length may leak; every character is compared.
  unsigned difference = expected.size() == given.size() ? 0 : 1;
  for (std::size_t i = 0; i < given.size() && !expected.empty(); ++i) {
    difference |=
        static_cast<unsigned char>(expected[i % expected.size()]) ^ static_cast<unsigned char>(given[i]);
  }
  return difference == 0;
}

}  // namespace swiftlet
