#include "firmware_host/outputs/map_files/kept_graph_file.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <fstream>
#include <iterator>

#include "drivers/device/byte_fields.hpp"
#include "drivers/input/input_error.hpp"
#include "drivers/recorded/recording_checksum.hpp"
#include "drivers/recorded/recording_header.hpp"

namespace swiftlet {
namespace {

constexpr std::array<std::uint8_t, 8> kGraphMagic{0x89, 'S', 'W', 'G', '\r', '\n', 0x1A, '\n'};
constexpr std::uint32_t kGraphVersion = 1;
/// Magic, version, nodes, loops, camera.
constexpr std::size_t kGraphHeadBytes = 8 + 3 * 4 + kCameraBytes;
constexpr std::size_t kGraphCovarianceBytes = 21 * 8;
/// Stamp, pose, up, covariance of the tilt, flags, relative pose with covariance, number of features.
constexpr std::size_t kGraphNodeBytes = 8 + 7 * 8 + 3 * 8 + 6 * 8 + 4 + 7 * 8 + kGraphCovarianceBytes + 4;
constexpr std::size_t kGraphFeatureBytes = 32 + 7 * 4 + 4;
constexpr std::size_t kGraphLoopBytes = 2 * 4 + 7 * 8 + kGraphCovarianceBytes;
constexpr std::size_t kGraphCrcBytes = 4;
constexpr std::uint32_t kGraphLinked = 1;

// Tolerance for unit vectors, which other programs may have rounded when writing.
constexpr double kUnitTolerance = 1e-3;
// Far beyond any building; a larger number means damage.
constexpr double kFar = 1e6;  // m
constexpr int kMostOctaves = 16;

class GraphWriter {
 public:
  explicit GraphWriter(std::size_t bytes) : bytes_(bytes), to_(bytes_) {}

  std::vector<std::uint8_t> operator()(const KeptGraph& graph) {
    to_.copy(kGraphMagic);
    to_.u32(kGraphVersion);
    to_.u32(static_cast<std::uint32_t>(graph.nodes.size()));
    to_.u32(static_cast<std::uint32_t>(graph.loops.size()));
    encodeCamera(to_, graph.camera, graph.T_body_cam);
    for (const KeptNode& it : graph.nodes) node(it);
    for (const KeptLoop& loop : graph.loops) {
      to_.u32(loop.from);
      to_.u32(loop.to);
      pose(loop.T_from_to);
      symmetric(loop.covariance);
    }
    to_.u32(crc32c(0, {bytes_.data(), bytes_.size() - kGraphCrcBytes}));
    return std::move(bytes_);
  }

 private:
  void pose(const SE3& T) {
    for (int i = 0; i < 3; ++i) to_.f64(T.translation[i]);
    for (int i = 0; i < 4; ++i) to_.f64(T.rotation.coeffs()[i]);
  }
  template <typename Matrix>
  void symmetric(const Matrix& m) {
    for (int r = 0; r < m.rows(); ++r) {
      for (int c = r; c < m.cols(); ++c) to_.f64(m(r, c));
    }
  }
  void node(const KeptNode& node) {
    to_.i64(node.stamp.ns);
    pose(node.T_map_body);
    for (int i = 0; i < 3; ++i) to_.f64(node.tilt.up_body[i]);
    symmetric(node.tilt.covariance);
    to_.u32(node.linked ? kGraphLinked : 0U);
    pose(node.T_previous_this);
    symmetric(node.covariance);
    to_.u32(static_cast<std::uint32_t>(node.features.size()));
    for (const PlaceFeature& feature : node.features) {
      for (const std::uint64_t word : feature.descriptor.words) to_.u64(word);
      for (int i = 0; i < 2; ++i) to_.f32(feature.pixel[i]);
      for (int i = 0; i < 3; ++i) to_.f32(feature.bearing[i]);
      to_.f32(feature.inverse_depth);
      to_.f32(feature.inverse_depth_sigma);
      to_.u32(static_cast<std::uint32_t>(feature.octave));
    }
  }

  std::vector<std::uint8_t> bytes_;
  LittleFieldWriter to_;
};

class GraphReader {
 public:
  GraphReader(const std::string& name, std::span<const std::uint8_t> bytes)
      : name_(name), size_(bytes.size()), from_(bytes) {}

  KeptGraph operator()(std::span<const std::uint8_t> bytes) {
    const auto magic = from_.bytes(kGraphMagic.size());
    if (!std::equal(magic.begin(), magic.end(), kGraphMagic.begin(), kGraphMagic.end())) {
      throw InputError(name_, 0, "byte 0: magic", "this is not a graph kept by swiftlet",
                       "Give a folder written by --keep-map");
    }
    const std::uint32_t version = from_.u32();
    if (version != kGraphVersion) {
      throw InputError(name_, 0, "byte 8: version",
                       fmt::format("is {}, this program reads {}", version, kGraphVersion),
                       "Use the program that kept the map, or keep a new one");
    }
    demand(bytes.size() >= kGraphHeadBytes + kGraphCrcBytes, "head", "is incomplete: the file ends early");
    const std::span<const std::uint8_t> covered = bytes.first(bytes.size() - kGraphCrcBytes);
    LittleFieldReader crc(bytes.subspan(covered.size()));
    demand(crc.u32() == crc32c(0, covered), "checksum", "does not match the data: the file is damaged");
    const std::uint32_t nodes = from_.u32();
    const std::uint32_t loops = from_.u32();
    demand(nodes <= from_.left() / kGraphNodeBytes, "nodes", "are too many for the size of the file");
    KeptGraph graph;
    demand(decodeCamera(from_, graph.camera, graph.T_body_cam), "camera", "is invalid");
    demandPose(graph.T_body_cam, "T_body_cam");
    graph.nodes.resize(nodes);
    for (KeptNode& it : graph.nodes) node(it);
    demand(from_.left() == loops * kGraphLoopBytes + kGraphCrcBytes, "loops",
           "do not match the rest of the file");
    for (std::uint32_t i = 0; i < loops; ++i) {
      KeptLoop& loop = graph.loops.emplace_back();
      loop.from = from_.u32();
      loop.to = from_.u32();
      demand(loop.from < loop.to && loop.to < nodes, "loop", "does not lead from a node to a later one");
      loop.T_from_to = pose("loop");
      loop.covariance = symmetric<6>("loop's covariance");
    }
    return graph;
  }

 private:
  void demand(bool holds, const char* field, const char* message) const {
    if (holds) return;
    throw InputError(name_, 0, fmt::format("byte {}: {}", size_ - from_.left(), field), message,
                     "Use another copy of the map, or keep a new one. Nothing was loaded");
  }
  template <int kSize>
  Eigen::Matrix<double, kSize, 1> vector() {
    Eigen::Matrix<double, kSize, 1> out;
    for (double& value : out) value = from_.f64();
    return out;
  }
  SE3 pose(const char* field) {
    SE3 T;
    T.translation = vector<3>();
    T.rotation.coeffs() = vector<4>();
    demandPose(T, field);
    return T;
  }
  void demandPose(const SE3& T, const char* field) const {
    demand(T.translation.allFinite() && T.translation.norm() < kFar, field, "is not a position");
    demand(std::abs(T.rotation.norm() - 1) < kUnitTolerance, field, "is not a rotation");
  }
  template <int kSize>
  Eigen::Matrix<double, kSize, kSize> symmetric(const char* field) {
    Eigen::Matrix<double, kSize, kSize> m;
    for (int r = 0; r < kSize; ++r) {
      for (int c = r; c < kSize; ++c) m(r, c) = m(c, r) = from_.f64();
    }
    demand(m.allFinite() && m.diagonal().minCoeff() >= 0, field, "is not a covariance");
    return m;
  }
  void node(KeptNode& node) {
    demand(from_.left() >= kGraphNodeBytes, "node", "is incomplete: the file ends early");
    node.stamp.ns = from_.i64();
    node.T_map_body = pose("pose of a node");
    node.tilt.up_body = vector<3>();
    demand(std::abs(node.tilt.up_body.norm() - 1) < kUnitTolerance, "vertical of a node",
           "is not a unit vector");
    node.tilt.covariance = symmetric<3>("covariance of a tilt");
    const std::uint32_t flags = from_.u32();
    demand(flags <= kGraphLinked, "flags of a node", "are unknown to this version");
    node.linked = flags == kGraphLinked;
    node.T_previous_this = pose("relative pose of a node");
    node.covariance = symmetric<6>("covariance of a node");
    const std::uint32_t features = from_.u32();
    demand(features <= kMaxPlaceFeatures && features <= from_.left() / kGraphFeatureBytes,
           "features of a node", "are more than a place can have");
    node.features.resize(features);
    for (PlaceFeature& it : node.features) feature(it);
  }
  void feature(PlaceFeature& feature) {
    for (std::uint64_t& word : feature.descriptor.words) word = from_.u64();
    for (float& value : feature.pixel) value = from_.f32();
    for (float& value : feature.bearing) value = from_.f32();
    feature.inverse_depth = from_.f32();
    feature.inverse_depth_sigma = from_.f32();
    const std::uint32_t octave = from_.u32();
    demand(feature.pixel.allFinite(), "pixel of a feature", "is not finite");
    demand(std::abs(feature.bearing.norm() - 1) < static_cast<float>(kUnitTolerance), "bearing of a feature",
           "is not a unit vector");
    demand(std::isfinite(feature.inverse_depth) && std::isfinite(feature.inverse_depth_sigma) &&
               feature.inverse_depth_sigma >= 0,
           "depth of a feature", "is invalid");
    demand(octave < kMostOctaves, "octave of a feature", "is invalid");
    feature.octave = static_cast<std::int8_t>(octave);
  }

  const std::string& name_;
  std::size_t size_;
  LittleFieldReader from_;
};

}  // namespace

std::vector<std::uint8_t> keptGraphBytes(const KeptGraph& graph) {
  std::size_t bytes = kGraphHeadBytes + graph.loops.size() * kGraphLoopBytes + kGraphCrcBytes;
  for (const KeptNode& node : graph.nodes)
    bytes += kGraphNodeBytes + node.features.size() * kGraphFeatureBytes;
  return GraphWriter(bytes)(graph);
}

KeptGraph readKeptGraph(const std::string& name, std::span<const std::uint8_t> bytes) {
  return GraphReader(name, bytes)(bytes);
}

KeptGraph readKeptGraphFile(const std::string& path) {
  std::ifstream in(path, std::ios::binary);
  if (!in) {
    throw InputError(path, 0, "", "cannot be opened", "Give a folder written by --keep-map");
  }
  const std::vector<char> bytes{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  return readKeptGraph(path, {reinterpret_cast<const std::uint8_t*>(bytes.data()), bytes.size()});
}

}  // namespace swiftlet
