#include "firmware_host/outputs/map_files/ply_values.hpp"

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <type_traits>

#include "drivers/recorded/csv_reader.hpp"
#include "drivers/recorded/parse_number.hpp"

namespace swiftlet {
namespace {

static_assert(std::endian::native == std::endian::little, "binary PLY is copied as it lies in memory");

constexpr const char* kBlanks = " \t\r";
constexpr const char* kCutShort = "The file is truncated: write it again";

double decode(PlyType type, const char* bytes) {
  return withNumber(type, [bytes](auto number) {
    std::memcpy(&number, bytes, sizeof number);
    return static_cast<double>(number);
  });
}

bool holds(PlyType type, double value) {
  return withNumber(type, [value]<typename Number>(Number) {
    if constexpr (std::is_floating_point_v<Number>) return true;
    return value >= std::numeric_limits<Number>::min() && value <= std::numeric_limits<Number>::max() &&
           value == std::floor(value);
  });
}

}  // namespace

PlyValues::PlyValues(const std::string& name, std::string_view bytes, const PlyHeader& header)
    : name_(name),
      bytes_(bytes),
      binary_(header.binary),
      at_(header.size),
      from_(header.size),
      line_(header.lines) {}

void PlyValues::beginRow(const PlyElement& element, std::uint64_t index) {
  element_ = &element;
  index_ = index;
  if (binary_) return;
  do {
    if (at_ >= bytes_.size()) {
      throw error("", "is missing: the file ends early", kCutShort);
    }
    const std::size_t end = std::min(bytes_.find('\n', at_), bytes_.size());
    row_ = bytes_.substr(at_, end - at_);
    at_ = end + 1;
    ++line_;
  } while (row_.find_first_not_of(kBlanks) == std::string_view::npos);
}

void PlyValues::endRow() {
  if (binary_) return;
  const std::string_view word = takeWord();
  if (!word.empty()) {
    throw error("", quoteInput(word) + " is more than the header declares", "Write the file again");
  }
}

std::string_view PlyValues::takeWord() {
  row_.remove_prefix(std::min(row_.find_first_not_of(kBlanks), row_.size()));
  const std::string_view word = row_.substr(0, row_.find_first_of(kBlanks));
  row_.remove_prefix(word.size());
  return word;
}

double PlyValues::nextText(PlyType type, std::string_view property) {
  const std::string_view word = takeWord();
  if (word.empty()) throw error(property, "missing", kCutShort);
  double value = 0;
  if (!parseDouble(word, value))
    throw error(property, quoteInput(word) + " is not a number", "Repair the line");
  if (!holds(type, value)) {
    throw error(property, quoteInput(word) + " does not fit its type", "Repair the line or the header");
  }
  return value;
}

double PlyValues::nextBinary(PlyType type, std::string_view property) {
  from_ = at_;
  const std::size_t size = sizeOf(type);
  if (bytes_.size() - at_ < size) throw error(property, "is missing: the file ends early", kCutShort);
  at_ += size;
  return decode(type, bytes_.data() + from_);
}

double PlyValues::next(PlyType type, std::string_view property) {
  return binary_ ? nextBinary(type, property) : nextText(type, property);
}

std::uint64_t PlyValues::nextLength(PlyType type, std::string_view property) {
  const double length = next(type, property);
  if (length < 0) throw error(property, "a list of negative length", "Write the file again");
  return static_cast<std::uint64_t>(length);
}

void PlyValues::finish() {
  element_ = nullptr;
  if (at_ >= bytes_.size()) return;
  const std::string_view rest = bytes_.substr(at_);
  if (!binary_ && rest.find_first_not_of(" \t\r\n") == std::string_view::npos) return;
  from_ = at_;
  ++line_;
  throw error("", std::to_string(rest.size()) + " bytes after the last element",
              "A count in the header is wrong, or the file was overwritten: write it again");
}

InputError PlyValues::error(std::string_view property, const std::string& message,
                            const std::string& remedy) const {
  std::string field;
  if (element_ != nullptr) {
    field = quoteInput(element_->name) + " " + std::to_string(index_);
    if (!property.empty()) field += " " + quoteInput(property);
  }
  if (binary_) field += (field.empty() ? "byte " : " at byte ") + std::to_string(from_);
  return {name_, binary_ ? 0 : line_, field, message, remedy};
}

}  // namespace swiftlet
