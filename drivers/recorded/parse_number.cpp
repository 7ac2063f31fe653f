#include "drivers/recorded/parse_number.hpp"

#include <charconv>

#include "drivers/input/stamp_range.hpp"

namespace swiftlet {
namespace {

bool allDigits(std::string_view text) {
  for (const char c : text) {
    if (c < '0' || c > '9') return false;
  }
  return true;
}

}  // namespace

bool parseDouble(std::string_view text, double& value) {
  if (text.starts_with('+')) text.remove_prefix(1);
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  return !text.empty() && code == std::errc{} && end == text.data() + text.size();
}

bool parseInteger(std::string_view text, std::int64_t& value) {
  if (text.starts_with('+')) text.remove_prefix(1);
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  return !text.empty() && code == std::errc{} && end == text.data() + text.size();
}

bool parseSeconds(std::string_view text, Stamp& stamp) {
  const std::size_t point = text.find('.');
  const std::string_view whole = text.substr(0, point);
  std::string_view fraction = point == std::string_view::npos ? std::string_view{} : text.substr(point + 1);
  std::int64_t seconds = 0;
  if (!parseInteger(whole, seconds) || !allDigits(fraction)) return false;
  constexpr std::int64_t kMaxSeconds = kLargestStamp / kNsPerSecond - 1;
  if (seconds > kMaxSeconds || seconds < -kMaxSeconds) return false;
  fraction = fraction.substr(0, 9);
  std::int64_t ns = 0;
  for (std::size_t i = 0; i < 9; ++i) ns = 10 * ns + (i < fraction.size() ? fraction[i] - '0' : 0);
  stamp.ns = seconds * kNsPerSecond + (whole.starts_with('-') ? -ns : ns);
  return true;
}

bool parseNanoseconds(std::string_view text, Stamp& stamp) {
  const std::size_t point = text.find('.');
  if (point != std::string_view::npos && !allDigits(text.substr(point + 1))) return false;
  return parseInteger(text.substr(0, point), stamp.ns) && isStampInRange(stamp.ns);
}

bool parseCsvStamp(std::string_view text, Stamp& stamp) {
  return text.find('.') == std::string_view::npos ? parseNanoseconds(text, stamp) : parseSeconds(text, stamp);
}

}  // namespace swiftlet
