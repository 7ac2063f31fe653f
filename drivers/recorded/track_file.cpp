#include "drivers/recorded/track_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <cmath>
#include <cstring>

#include "drivers/recorded/parse_number.hpp"

namespace swiftlet {
namespace {

constexpr std::array<std::array<const char*, 2>, kMaxCameras> kPixelNames = {{{"u0", "v0"}, {"u1", "v1"}}};
// Far outside any image: a number like this is damage.
constexpr double kMaxPixel = 1e5;

bool readPixel(CsvReader& csv, std::size_t camera, TrackedFeature& feature) {
  const std::size_t column = 2 + 2 * camera;
  feature.seen[camera] = false;
  if (csv.field(column).empty() && csv.field(column + 1).empty()) return true;
  std::array<double, 2> uv{};
  if (!csv.numbers(column, kPixelNames[camera], uv.data())) return false;
  if (std::abs(uv[0]) > kMaxPixel || std::abs(uv[1]) > kMaxPixel) {
    csv.reject(kPixelNames[camera][0], "a pixel far outside any image");
    return false;
  }
  feature.seen[camera] = true;
  feature.pixel[camera] = {static_cast<float>(uv[0]), static_cast<float>(uv[1])};
  return true;
}

bool isFrameOnly(const CsvReader& csv) {
  for (std::size_t i = 1; i < csv.size(); ++i) {
    if (!csv.field(i).empty()) return false;
  }
  return true;
}

}  // namespace

TrackReader::TrackReader(const std::string& path, LogCounters& counters, LogWarnings& warnings)
    : csv_(path, CsvReader::Separator::kComma, counters, warnings) {}

TrackReader::TrackReader(const std::string& name, std::string_view text, LogCounters& counters,
                         LogWarnings& warnings)
    : csv_(name, text, CsvReader::Separator::kComma, counters, warnings) {}

TrackReader::Row TrackReader::readRow() {
  while (csv_.next(1)) {
    if (!parseCsvStamp(csv_.field(0), pending_stamp_)) {
      csv_.reject("timestamp", "not a stamp in ns");
      continue;
    }
    if (any_ && pending_stamp_ < newest_) {
      csv_.reject("timestamp", "earlier than the row before");
      continue;
    }
    if (isFrameOnly(csv_)) {
      if (!any_ || pending_stamp_ != newest_) ids_.clear();
      newest_ = pending_stamp_;
      any_ = true;
      return Row::kFrame;
    }
    TrackedFeature feature;
    std::int64_t id = 0;
    if (!parseInteger(csv_.field(1), id) || id < 0) {
      csv_.reject("track", "not a whole number from 0");
      continue;
    }
    feature.id = static_cast<TrackId>(id);
    if (!readPixel(csv_, 0, feature) || !readPixel(csv_, 1, feature)) continue;
    if (!feature.seen[0] && !feature.seen[1]) {
      csv_.reject("u0", "a track that no camera saw");
      continue;
    }
    if (!any_ || pending_stamp_ != newest_) ids_.clear();
    if (!ids_.insert(feature.id).second) {
      csv_.reject("track", "twice in one frame");
      continue;
    }
    pending_feature_ = feature;
    newest_ = pending_stamp_;
    any_ = true;
    return Row::kFeature;
  }
  return Row::kEnd;
}

bool TrackReader::next(TrackRecord& record) {
  if (ended_) return false;
  if (!pending_) pending_kind_ = readRow();
  pending_ = false;
  record.features.clear();
  if (pending_kind_ == Row::kEnd) {
    ended_ = true;
    csv_.finish("tracks", "A row is: stamp [ns], track id, u0, v0, u1, v1");
    return false;
  }
  record.stamp = pending_stamp_;
  while (pending_kind_ != Row::kEnd && pending_stamp_ == record.stamp) {
    if (pending_kind_ == Row::kFeature) record.features.push_back(pending_feature_);
    pending_kind_ = readRow();
  }
  pending_ = true;
  return true;
}

TrackWriter::TrackWriter(const std::string& path) : path_(path), file_(std::fopen(path.c_str(), "wb")) {
  if (file_ == nullptr) {
    throw InputError(path, 0, "", std::string("cannot be written: ") + std::strerror(errno), "");
  }
  std::fputs("#timestamp [ns],track,u0 [px],v0 [px],u1 [px],v1 [px]\n", file_);
}

TrackWriter::~TrackWriter() {
  if (file_ != nullptr) std::fclose(file_);
}

void TrackWriter::write(const TrackRecord& record) {
  std::string lines;
  for (const TrackedFeature& feature : record.features) {
    lines += fmt::format("{},{}", record.stamp.ns, feature.id);
    for (std::size_t c = 0; c < kMaxCameras; ++c) {
      // Shortest text that reads back to the same float.
      lines += feature.seen[c] ? fmt::format(",{},{}", feature.pixel[c].x(), feature.pixel[c].y()) : ",,";
    }
    lines += '\n';
  }
  if (record.features.empty()) lines = fmt::format("{},,,,,\n", record.stamp.ns);
  if (std::fwrite(lines.data(), 1, lines.size(), file_) != lines.size()) {
    throw InputError(path_, 0, "", std::string("cannot be written: ") + std::strerror(errno),
                     "Is the disk full?");
  }
}

void TrackWriter::close() {
  std::FILE* file = file_;
  file_ = nullptr;
  if (file != nullptr && std::fclose(file) != 0) {
    throw InputError(path_, 0, "", std::string("cannot be written: ") + std::strerror(errno),
                     "Is the disk full?");
  }
}

}  // namespace swiftlet
