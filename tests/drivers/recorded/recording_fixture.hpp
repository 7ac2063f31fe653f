#pragma once
// Recordings for tests: scripts of what enters an estimator, segments in memory, and the comparison of
// what comes back with what went in, bit for bit.

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "drivers/recorded/recording_source.hpp"
#include "drivers/recorded/recording_writer.hpp"

namespace swiftlet::test {

using Bytes = std::vector<std::uint8_t>;

/// One call of the writer.
struct Entry {
  RecordKind kind = RecordKind::kImu;
  ImuSample sample;
  Stamp arrival;
  CameraFrame frame;  ///< `image` points into `pixels` or is empty
  Bytes pixels;       ///< with gaps between the rows where the stride says so
  PropagateStep propagate;
  TrackStep track;
  SmoothStep smooth;
  MeshStep mesh;
  LoopStep loop;
  MapStep map;
  SceneImages scene;         ///< its labels point into `pixels`, its depth into `depth`, or are empty
  std::vector<float> depth;  ///< m
  RecordingLoss loss;

  Entry() = default;
  Entry(const Entry&) = delete;
  Entry(Entry&&) = default;  // a vector's memory moves with it, so `image` stays right
  Entry& operator=(const Entry&) = delete;
  Entry& operator=(Entry&&) = default;
};

Status record(RecordingWriter& writer, const Entry& entry);

/// Entry `i` of a script: every kind, NaN, infinities, denormals, extreme stamps, empty images, strides.
Entry wildEntry(std::uint64_t seed, std::uint64_t i);
std::vector<Entry> wildScript(std::uint64_t seed, std::size_t count);

/// Two cameras and a depth sensor with doubles that no text would bring back.
RecordingHeader wildHeader(RecordOrder order);

/// What differs between the recording and the first `count` entries; empty when nothing does. Reads the
/// source to its end. The messages must come in the script's order.
std::string difference(RecordingSource& source, const std::vector<Entry>& script, std::size_t count);
bool sameBits(const ImuSample& a, const ImuSample& b);
bool sameFrame(const CameraFrame& a, const CameraFrame& b);
bool sameScene(const SceneImages& a, const SceneImages& b);
bool sameRig(const Rig& a, const Rig& b);

class MemoryFile final : public RecordingFile {
 public:
  MemoryFile(std::string name, Bytes bytes) : name_(std::move(name)), bytes_(std::move(bytes)) {}
  [[nodiscard]] const std::string& name() const override { return name_; }
  [[nodiscard]] std::uint64_t size() const override { return bytes_.size(); }
  std::size_t read(std::uint64_t offset, std::span<std::uint8_t> out) const override;

 private:
  std::string name_;
  Bytes bytes_;
};

RecordingFiles inMemory(const std::vector<Bytes>& segments);
std::vector<Bytes> readSegments(const std::filesystem::path& folder);

/// A recording of a script in a temporary folder, already read back into memory.
struct RecordedScript {
  std::vector<Entry> script;
  std::vector<Bytes> segments;
  /// Where record i ends in the segments put one after the other; 0 is the run's header, the last the end
  /// mark.
  std::vector<std::uint64_t> ends;

  [[nodiscard]] std::uint64_t begin(std::size_t segment) const;
  [[nodiscard]] std::uint64_t size() const { return begin(segments.size()); }
  [[nodiscard]] std::uint8_t& byte(std::uint64_t at);
  /// Records that end at or before byte `at`.
  [[nodiscard]] std::size_t wholeBefore(std::uint64_t at) const;
};
RecordedScript recordScript(std::uint64_t seed, std::size_t count, std::size_t segment_bytes);

}  // namespace swiftlet::test
