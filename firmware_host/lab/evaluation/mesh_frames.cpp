#include "firmware_host/lab/evaluation/mesh_frames.hpp"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "drivers/recorded/csv_reader.hpp"
#include "drivers/recorded/parse_number.hpp"

namespace swiftlet {
namespace {

constexpr const char* kRemedy = "Write the meshes again";
constexpr std::size_t kColumns = 5;  ///< the sixth, the hull, may be missing

/// False for text and for an odd number of values.
bool readHull(std::string_view text, std::vector<Eigen::Vector2f>& hull) {
  std::vector<double> numbers;
  while (true) {
    text.remove_prefix(std::min(text.find_first_not_of(' '), text.size()));
    if (text.empty()) break;
    const std::string_view word = text.substr(0, text.find(' '));
    text.remove_prefix(word.size());
    double number = 0;
    if (!parseDouble(word, number) || !(std::abs(number) < 1e6)) return false;
    numbers.push_back(number);
  }
  for (std::size_t i = 0; i + 1 < numbers.size(); i += 2) {
    hull.push_back(Eigen::Vector2d(numbers[i], numbers[i + 1]).cast<float>());
  }
  return numbers.size() % 2 == 0;
}

}  // namespace

std::vector<MeshFrame> readMeshFrames(const std::string& folder) {
  const std::filesystem::path path(folder);
  LogCounters counters;
  LogWarnings warnings;
  CsvReader csv(path / "frames.csv", CsvReader::Separator::kComma, counters, warnings);
  std::vector<MeshFrame> frames;
  const auto fileOf = [&](std::size_t i) {
    const std::string_view name = csv.field(i);
    return name.empty() ? std::string() : (path / name).string();
  };
  while (csv.next(kColumns)) {
    MeshFrame frame;
    std::int64_t keyframe = 0;
    if (!csv.integer(0, "frame", frame.frame) || !csv.integer(1, "stamp", frame.stamp.ns) ||
        !csv.integer(2, "keyframe", keyframe)) {
      continue;
    }
    frame.keyframe = keyframe != 0;
    frame.frame_mesh = fileOf(3);
    frame.horizon_mesh = fileOf(4);
    if (!readHull(csv.field(kColumns), frame.hull)) {
      throw csv.error("hull", "is not a list of number pairs separated by blanks", kRemedy);
    }
    if (!frames.empty() && frame.stamp <= frames.back().stamp) {
      throw csv.error("stamp", "is not later than the previous one", kRemedy);
    }
    frames.push_back(std::move(frame));
  }
  if (csv.firstBad()) throw InputError(*csv.firstBad());
  return frames;
}

}  // namespace swiftlet
