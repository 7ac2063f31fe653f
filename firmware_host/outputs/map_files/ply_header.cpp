#include "firmware_host/outputs/map_files/ply_header.hpp"

#include <algorithm>
#include <array>
#include <optional>

#include "drivers/input/input_error.hpp"
#include "drivers/recorded/csv_reader.hpp"
#include "drivers/recorded/parse_number.hpp"

namespace swiftlet {
namespace {

// More than any program writes; limits the work that a header alone can cause.
constexpr int kMaxHeaderLines = 1000;
constexpr std::size_t kMaxProperties = 64;  ///< of one element
constexpr const char* kBadHeader = "Check that it is a complete PLY file";

struct TypeName {
  std::string_view name;
  PlyType type;
};
constexpr std::array<TypeName, 16> kTypeNames = {{{"char", PlyType::kInt8},
                                                  {"int8", PlyType::kInt8},
                                                  {"uchar", PlyType::kUint8},
                                                  {"uint8", PlyType::kUint8},
                                                  {"short", PlyType::kInt16},
                                                  {"int16", PlyType::kInt16},
                                                  {"ushort", PlyType::kUint16},
                                                  {"uint16", PlyType::kUint16},
                                                  {"int", PlyType::kInt32},
                                                  {"int32", PlyType::kInt32},
                                                  {"uint", PlyType::kUint32},
                                                  {"uint32", PlyType::kUint32},
                                                  {"float", PlyType::kFloat},
                                                  {"float32", PlyType::kFloat},
                                                  {"double", PlyType::kDouble},
                                                  {"float64", PlyType::kDouble}}};

class HeaderReader {
 public:
  HeaderReader(const std::string& name, std::string_view bytes) : name_(name), rest_(bytes), all_(bytes) {}

  PlyHeader operator()() {
    if (nextLine() != "ply") fail("", "does not begin with `ply`", "Give a PLY file");
    readFormat();
    while (true) {
      const std::string_view line = nextLine();
      if (line == "end_header") break;
      readLine(line);
    }
    header_.size = all_.size() - rest_.size();
    checkCounts();
    return header_;
  }

 private:
  [[noreturn]] void fail(const std::string& field, const std::string& message,
                         const std::string& remedy) const {
    throw InputError(name_, header_.lines, field, message, remedy);
  }

  /// The next line without its line end; fails if the header ends before `end_header`.
  std::string_view nextLine() {
    ++header_.lines;
    const std::size_t end = rest_.find('\n');
    if (end == std::string_view::npos || header_.lines > kMaxHeaderLines) {
      fail("", "the header has no end", kBadHeader);
    }
    std::string_view line = rest_.substr(0, end);
    rest_.remove_prefix(end + 1);
    if (line.ends_with('\r')) line.remove_suffix(1);
    return line;
  }

  static std::vector<std::string_view> words(std::string_view line) {
    std::vector<std::string_view> result;
    while (true) {
      const std::size_t begin = line.find_first_not_of(" \t");
      if (begin == std::string_view::npos) return result;
      line.remove_prefix(begin);
      const std::size_t size = std::min(line.find_first_of(" \t"), line.size());
      result.push_back(line.substr(0, size));
      line.remove_prefix(size);
    }
  }

  void readFormat() {
    const auto word = words(nextLine());
    const bool shaped = word.size() == 3 && word[0] == "format" && word[2] == "1.0";
    if (shaped && word[1] == "ascii") return;
    header_.binary = shaped && word[1] == "binary_little_endian";
    if (header_.binary) return;
    fail("format", shaped ? quoteInput(word[1]) + " is not supported" : "is missing or not version 1.0",
         "Save it as ASCII or binary little-endian PLY 1.0");
  }

  void readLine(std::string_view line) {
    const auto word = words(line);
    if (word.empty() || word[0] == "comment" || word[0] == "obj_info") return;
    if (word[0] == "element") {
      readElement(word);
    } else if (word[0] == "property") {
      readProperty(word);
    } else {
      fail("", quoteInput(line) + " is not a valid line of a PLY header", kBadHeader);
    }
  }

  void readElement(const std::vector<std::string_view>& word) {
    PlyElement element;
    std::int64_t count = 0;
    if (word.size() != 3 || !parseInteger(word[2], count) || count < 0) {
      fail("element", "is not `element NAME COUNT`", kBadHeader);
    }
    element.name = word[1];
    element.count = static_cast<std::uint64_t>(count);
    if (std::ranges::count(header_.elements, element.name, &PlyElement::name) > 0) {
      fail("element", quoteInput(word[1]) + " appears twice", kBadHeader);
    }
    header_.elements.push_back(element);
  }

  PlyType type(std::string_view word) const {
    const auto* const found = std::ranges::find(kTypeNames, word, &TypeName::name);
    if (found == kTypeNames.end()) fail("property", quoteInput(word) + " is not a PLY type", kBadHeader);
    return found->type;
  }

  void readProperty(const std::vector<std::string_view>& word) {
    PlyProperty property;
    property.is_list = word.size() == 5 && word[1] == "list";
    if ((word.size() != 3 && !property.is_list) || header_.elements.empty()) {
      fail("property", "is not `property TYPE NAME` of an element", kBadHeader);
    }
    if (property.is_list) property.count_type = type(word[2]);
    if (property.count_type == PlyType::kFloat || property.count_type == PlyType::kDouble) {
      fail("property", "the length of a list is not an integer", kBadHeader);
    }
    property.type = type(word[word.size() - 2]);
    property.name = word.back();
    auto& properties = header_.elements.back().properties;
    if (std::ranges::count(properties, property.name, &PlyProperty::name) > 0) {
      fail("property", quoteInput(property.name) + " appears twice", kBadHeader);
    }
    if (properties.size() == kMaxProperties) fail("property", "too many in one element", kBadHeader);
    properties.push_back(property);
  }

  /// Minimum size of a row: its values and the lengths of its lists. In ASCII, each has at least one digit
  /// and a blank or line end.
  [[nodiscard]] std::uint64_t leastBytes(const PlyElement& element) const {
    std::uint64_t bytes = 0;
    for (const PlyProperty& property : element.properties) {
      const std::size_t size = sizeOf(property.is_list ? property.count_type : property.type);
      bytes += header_.binary ? size : 2;
    }
    return bytes;
  }

  void checkCounts() const {
    // The last line of an ASCII file may lack a line end.
    std::uint64_t left = rest_.size() + (header_.binary ? 0 : 1);
    for (const PlyElement& element : header_.elements) {
      const std::uint64_t least = leastBytes(element);
      const std::string field = "element " + quoteInput(element.name);
      if (element.count == 0) continue;
      if (least == 0) throw InputError(name_, 0, field, "has no properties", kBadHeader);
      if (element.count > left / least) {
        throw InputError(name_, 0, field,
                         std::to_string(element.count) + " of them need more than the " +
                             std::to_string(rest_.size()) + " bytes after the header",
                         "The file is truncated or its count is wrong: write it again");
      }
      left -= element.count * least;
    }
  }

  const std::string& name_;
  std::string_view rest_;
  std::string_view all_;
  PlyHeader header_;
};

}  // namespace

std::size_t sizeOf(PlyType type) {
  return withNumber(type, [](auto number) { return sizeof number; });
}

std::string_view nameOf(PlyType type) { return std::ranges::find(kTypeNames, type, &TypeName::type)->name; }

PlyHeader readPlyHeader(const std::string& name, std::string_view bytes) {
  return HeaderReader(name, bytes)();
}

}  // namespace swiftlet
