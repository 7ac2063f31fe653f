#include "drivers/recorded/track_file.hpp"

#include <fmt/format.h>

#include <cerrno>
#include <cmath>
#include <cstring>
#include <iterator>
#include <limits>
#include <memory>

namespace swiftlet {
namespace {

struct ColumnText {
  const char* name;
  const char* with_unit;
};
constexpr std::array<ColumnText, 6> kColumns = {{{"timestamp", "timestamp [ns]"},
                                                 {"id", "id"},
                                                 {"camera", "camera"},
                                                 {"u", "u [px]"},
                                                 {"v", "v [px]"},
                                                 {"keyframe", "keyframe"}}};
constexpr const char* kHeader = "#timestamp [ns],id,camera,u [px],v [px],keyframe";
constexpr const char* kHeaderRemedy =
    "Start the file with `#timestamp [ns],id,camera,u [px],v [px],keyframe` (keyframe is optional)";
constexpr const char* kRowRemedy =
    "Write each line as: stamp [ns], id, camera (0 or 1), u, v and, if the header has it, keyframe (0 or 1)";
constexpr const char* kDiskRemedy = "Check that the disk is not full";
// Far outside any image: a larger value is damage.
constexpr double kMaxPixel = 1e5;

/// Column names of the header line, without '#' and surrounding blanks.
std::vector<std::string_view> namesOf(std::string_view header) {
  if (header.starts_with('#')) header.remove_prefix(1);
  std::vector<std::string_view> names;
  while (true) {
    const std::size_t end = header.find(',');
    std::string_view name = header.substr(0, end);
    while (name.starts_with(' ') || name.starts_with('\t')) name.remove_prefix(1);
    while (name.ends_with(' ') || name.ends_with('\t')) name.remove_suffix(1);
    names.push_back(name);
    if (end == std::string_view::npos) return names;
    header.remove_prefix(end + 1);
  }
}

}  // namespace

TrackReader::TrackReader(const std::string& path)
    : csv_(path, CsvReader::Separator::kComma, counters_, warnings_) {
  begin();
}

TrackReader::TrackReader(const std::string& name, std::string_view text)
    : csv_(name, text, CsvReader::Separator::kComma, counters_, warnings_) {
  begin();
}

void TrackReader::begin() {
  static_assert(kColumns.size() == kColumnCount);
  more_ = csv_.next(0);
  checkHeader();
  refuseRejected();
  if (!more_) throw InputError(csv_.name(), 0, "", "holds no tracks", kRowRemedy);
  parseRow();
}

void TrackReader::checkHeader() {
  if (csv_.header().empty()) throw InputError(csv_.name(), 1, "header", "is missing", kHeaderRemedy);
  const std::vector<std::string_view> names = namesOf(csv_.header());
  const auto complain = [&](const std::string& message) {
    throw InputError(csv_.name(), csv_.headerLine(), "header", message, kHeaderRemedy);
  };
  for (std::size_t i = 0; i < names.size() && i < kColumnCount; ++i) {
    if (names[i] == kColumns[i].name || names[i] == kColumns[i].with_unit) continue;
    complain(fmt::format("column {} is {}, not `{}`", i + 1, quoteInput(names[i]), kColumns[i].with_unit));
  }
  if (names.size() < kKeyframe || names.size() > kColumnCount) {
    complain(fmt::format("has {} columns, not 5 or 6", names.size()));
  }
  columns_ = names.size();
}

/// A row that CsvReader itself rejects (too long, not a number) is an error here.
void TrackReader::refuseRejected() const {
  const auto& bad = csv_.firstBad();
  if (bad) throw InputError(bad->file, bad->line, bad->field, bad->message, kRowRemedy);
}

void TrackReader::refuse(Column column, const std::string& message, const char* remedy) const {
  throw csv_.error(kColumns[column].name, message, remedy);
}

bool TrackReader::readRow() {
  const bool found = csv_.next(0);
  refuseRejected();
  if (found) parseRow();
  return found;
}

/// An integer from 0 to `most`.
std::int64_t TrackReader::integer(Column column, std::int64_t most) {
  std::int64_t value = 0;
  if (!csv_.integer(column, kColumns[column].name, value)) refuseRejected();
  if (value < 0 || value > most) {
    refuse(column, fmt::format("{} is not within 0 and {}", value, most), kRowRemedy);
  }
  return value;
}

void TrackReader::parseRow() {
  constexpr std::int64_t kAny = std::numeric_limits<std::int64_t>::max();
  if (csv_.size() != columns_) {
    throw csv_.error("row", fmt::format("{} columns, but the header has {}", csv_.size(), columns_),
                     kRowRemedy);
  }
  const Stamp before = row_.stamp;
  row_ = {};
  row_.stamp.ns = integer(kStamp, kAny);
  if (any_ && row_.stamp < before) {
    refuse(kStamp, fmt::format("{} is earlier than {} in the previous line", row_.stamp.ns, before.ns),
           "Sort the lines by stamp");
  }
  any_ = true;
  row_.keyframe = hasKeyframes() && integer(kKeyframe, 1) == 1;
  for (const Column column : {kId, kCamera, kU, kV}) row_.sighting |= !csv_.field(column).empty();
  if (!row_.sighting) return;
  row_.id = static_cast<TrackId>(integer(kId, kAny));
  row_.camera = static_cast<std::size_t>(integer(kCamera, kMaxCameras - 1));
  Eigen::Vector2d pixel;
  const std::array<const char*, 2> names = {kColumns[kU].name, kColumns[kV].name};
  if (!csv_.numbers(kU, names, pixel.data())) refuseRejected();
  for (const Column column : {kU, kV}) {
    if (std::abs(pixel[column - kU]) <= kMaxPixel) continue;
    refuse(column, fmt::format("{} px is far outside any image", pixel[column - kU]), kRowRemedy);
  }
  row_.pixel = pixel.cast<float>();
}

bool TrackReader::next(TrackedFrame& frame) {
  if (!more_) return false;
  frame.stamp = row_.stamp;
  frame.index = next_index_++;
  frame.camera_present = {};
  frame.keyframe = row_.keyframe;
  frame.features.clear();
  slots_.clear();
  const std::uint64_t surplus_before = surplus_;
  while (more_ && row_.stamp == frame.stamp) {
    if (row_.keyframe != frame.keyframe) {
      refuse(kKeyframe, "differs from the frame's first line",
             "Use the same value in all lines with the same stamp");
    }
    if (row_.sighting) addSighting(frame);
    more_ = readRow();
  }
  if (surplus_ > surplus_before) {
    warnings_.addCounted(
        ++crowded_, fmt::format("{}: the frame at {} has {} tracks, only the first {} are used", csv_.name(),
                                frame.stamp.ns, slots_.size(), kMaxFeatures));
  }
  return true;
}

void TrackReader::addSighting(TrackedFrame& frame) {
  cameras_ = std::max(cameras_, row_.camera + 1);
  frame.camera_present[row_.camera] = true;
  const auto [slot, fresh] = slots_.try_emplace(row_.id, frame.features.size());
  if (fresh) {
    TrackedFeature feature;
    feature.id = row_.id;
    if (!frame.features.tryPushBack(feature)) {
      slot->second = kMaxFeatures;
      ++surplus_;
    }
  }
  if (slot->second == kMaxFeatures) return;
  TrackedFeature& feature = frame.features[slot->second];
  if (feature.seen[row_.camera]) {
    refuse(kId, fmt::format("{} appears twice in camera {} at one stamp", row_.id, row_.camera),
           "Give each landmark once per camera and frame");
  }
  feature.seen[row_.camera] = true;
  feature.pixel[row_.camera] = row_.pixel;
}

TrackFileFacts surveyTrackFile(const std::string& path) {
  TrackReader reader(path);
  TrackFileFacts facts;
  const auto frame = std::make_unique<TrackedFrame>();
  while (reader.next(*frame)) {
    if (facts.frames++ == 0) facts.first = frame->stamp;
    facts.last = frame->stamp;
  }
  facts.cameras = reader.cameras();
  return facts;
}

TrackWriter::TrackWriter(const std::string& path) : path_(path), file_(std::fopen(path.c_str(), "wb")) {
  if (file_ == nullptr) {
    throw InputError(path, 0, "", std::string("cannot be written: ") + std::strerror(errno), "");
  }
  std::fprintf(file_, "%s\n", kHeader);
}

TrackWriter::~TrackWriter() {
  if (file_ != nullptr) std::fclose(file_);
}

void TrackWriter::write(const TrackedFrame& frame) {
  const int keyframe = frame.keyframe ? 1 : 0;
  std::string lines;
  for (const TrackedFeature& feature : frame.features) {
    for (std::size_t c = 0; c < kMaxCameras; ++c) {
      if (!feature.seen[c]) continue;
      // `{}` gives the shortest text that reads back to the same float.
      fmt::format_to(std::back_inserter(lines), "{},{},{},{},{},{}\n", frame.stamp.ns, feature.id, c,
                     feature.pixel[c].x(), feature.pixel[c].y(), keyframe);
    }
  }
  if (lines.empty()) lines = fmt::format("{},,,,,{}\n", frame.stamp.ns, keyframe);
  if (std::fwrite(lines.data(), 1, lines.size(), file_) != lines.size()) {
    throw InputError(path_, 0, "", std::string("cannot be written: ") + std::strerror(errno), kDiskRemedy);
  }
}

void TrackWriter::close() {
  std::FILE* file = file_;
  file_ = nullptr;
  if (file != nullptr && std::fclose(file) != 0) {
    throw InputError(path_, 0, "", std::string("cannot be written: ") + std::strerror(errno), kDiskRemedy);
  }
}

}  // namespace swiftlet
