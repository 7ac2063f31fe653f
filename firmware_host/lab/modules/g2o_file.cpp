#include "firmware_host/lab/modules/g2o_file.hpp"

#include <algorithm>
#include <limits>

#include "drivers/input/input_error.hpp"
#include "drivers/input/read_file.hpp"
#include "drivers/input/unpack_xz.hpp"
#include "firmware_host/files/whole_file.hpp"

namespace swiftlet {
namespace {

/// A line number in InputError's type.
int lineOf(const G2oMessage& message) {
  constexpr std::size_t kLargest = std::numeric_limits<int>::max();
  return static_cast<int>(std::min(message.line, kLargest));
}

}  // namespace

G2oFile readG2oBytes(const std::string& name, std::string_view bytes) {
  std::string unpacked;
  if (isXz(bytes)) {
    unpacked = unpackXz(name, bytes, kMaxG2oText);
    bytes = unpacked;
  }
  G2oFile file;
  G2oMessage fault;
  if (!readG2o(bytes, file.graph, file.report, fault)) {
    throw InputError(name, lineOf(fault), fault.field, fault.text, fault.remedy);
  }
  return file;
}

G2oFile readG2oFile(const std::string& path) {
  const std::string bytes = readFile(path, "Give a .g2o or .g2o.xz file");
  if (bytes.size() > kMaxG2oText) {
    throw InputError(path, 0, "", "is larger than 1 GiB", "Check that it is a pose graph");
  }
  return readG2oBytes(path, bytes);
}

void writeG2oFile(const std::string& path, const G2oGraph& graph) { writeWholeFile(path, writeG2o(graph)); }

std::string warningText(const std::string& name, const G2oMessage& warning) {
  return InputError(name, lineOf(warning), warning.field, warning.text, warning.remedy).what();
}

}  // namespace swiftlet
