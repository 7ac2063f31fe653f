#include "firmware_host/outputs/view/live_images.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "estimator/core/units.hpp"

namespace swiftlet {
namespace {

using Json = nlohmann::ordered_json;

constexpr double kRateSpan = 1;  // s, over which a camera's rate is counted

// A tenth of a pixel is enough for display.
double shown(double pixel) { return std::round(10 * pixel) / 10; }

void addPixel(Json& json, const Eigen::Vector2f& pixel) {
  json.push_back(shown(pixel.x()));
  json.push_back(shown(pixel.y()));
}

}  // namespace

Json LiveImages::cameras() const {
  Json json = Json::array();
  for (std::size_t c = 0; c < rig_.camera_count; ++c) {
    json.push_back({{"width", rig_.camera[c].width()}, {"height", rig_.camera[c].height()}});
  }
  return json;
}

bool LiveImages::sample(LiveOutlet& outlet, double now, bool watched) {
  if (!outlet.images) return false;
  ImageFeed& feed = *outlet.images;
  feed.wanted.store(watched, std::memory_order_relaxed);
  receive(feed);
  if (!watched) {
    for (Camera& camera : camera_) camera.held.clear();
    waiting_ = -1;
    skip();
    return false;
  }
  const bool waits = std::ranges::any_of(camera_, [](const Camera& camera) { return !camera.held.empty(); });
  if (waits && waiting_ < 0) waiting_ = now;
  choose(feed, now);
  return fresh_;
}

void LiveImages::receive(ImageFeed& feed) {
  for (std::size_t c = 0; c < rig_.camera_count; ++c) {
    Camera& camera = camera_[c];
    Loan loan;
    while (feed.tryPop(c, loan)) {
      const CameraFrame& frame = loan->frame;
      const double span = (frame.stamp - camera.counted_stamp).seconds();
      if (camera.counted_from == 0 || span < 0 || span > 2 * kRateSpan) {
        camera.counted_from = frame.number;
        camera.counted_stamp = frame.stamp;
      } else if (span >= kRateSpan) {
        camera.rate = static_cast<double>(frame.number - camera.counted_from) / span;
        camera.counted_from = frame.number;
        camera.counted_stamp = frame.stamp;
      }
      camera.held.push_back(std::move(loan));
      // Two slots stay free for the next images.
      if (camera.held.size() > kViewQuota - 2) camera.held.pop_front();
    }
  }
}

void LiveImages::choose(ImageFeed& feed, double now) {
  const std::uint64_t number = feed.sight.refresh();
  const bool news = number != sight_number_;
  sight_number_ = number;
  bool found = false;
  if (news) {
    const SightNews& sight = feed.sight.value();
    for (std::size_t c = 0; c < rig_.camera_count; ++c) {
      Camera& camera = camera_[c];
      camera.shown.reset();
      while (!camera.held.empty() && camera.held.front()->frame.number < sight.image[c])
        camera.held.pop_front();
      if (camera.held.empty() || camera.held.front()->frame.number != sight.image[c]) continue;
      camera.shown = std::move(camera.held.front());
      camera.held.pop_front();
      found = true;
    }
    if (found) stamp_ = sight.stamp;
  } else if (waiting_ >= 0 && now - waiting_ > kPatience) {
    for (Camera& camera : camera_) {
      if (camera.held.empty()) continue;
      camera.shown = std::move(camera.held.back());
      camera.held.clear();
      stamp_ = camera.shown->frame.stamp;
      found = true;
    }
  }
  if (news || found) waiting_ = -1;
  if (!found) return;
  fresh_ = true;
  has_sight_ = news;
}

void LiveImages::skip() {
  for (Camera& camera : camera_) camera.shown.reset();
  fresh_ = false;
}

Json LiveImages::take(LiveOutlet& outlet, double t, const PictureSize& size) {
  Json json = {{"run", 0}, {"t", t}};
  if (has_sight_) {
    const SightNews& sight = outlet.images->sight.value();
    json["frame"] = sight.frame;
    json["keyframe"] = sight.keyframe;
    landmarks_.assign(sight.landmarks.begin(), sight.landmarks.end());
    std::ranges::sort(landmarks_);
  }
  outlet.images->loop.refresh();
  json["cameras"] = Json::array();
  for (std::size_t c = 0; c < rig_.camera_count; ++c) json["cameras"].push_back(cameraJson(outlet, c, size));
  skip();
  return json;
}

Json LiveImages::cameraJson(const LiveOutlet& outlet, std::size_t c, const PictureSize& size) {
  Camera& camera = camera_[c];
  if (!camera.shown) return nullptr;
  const CameraFrame& frame = camera.shown->frame;
  Json json = {{"src", coder_.encode(frame.image, size)}};
  if (camera.rate > 0) json["rate_hz"] = shown(camera.rate);
  const HostTimes& host = camera.shown->host;
  if (host.open > 0) json["exposure_ms"] = host.open * kToMs;
  if (host.gain > 0) json["gain"] = host.gain;
  if (has_sight_) addSight(outlet, c, json);
  return json;
}

void LiveImages::addSight(const LiveOutlet& outlet, std::size_t c, Json& json) const {
  const SightNews& sight = outlet.images->sight.value();
  Json& tracks = json["tracks"] = Json::array();
  for (const TrackedFeature& feature : sight.features) {
    if (!feature.seen[c]) continue;
    tracks.push_back(feature.id);
    addPixel(tracks, feature.pixel[c]);
    tracks.push_back(std::ranges::binary_search(landmarks_, feature.id) ? 1 : 0);
  }
  Json& rejected = json["rejected"] = Json::array();
  for (const LostSighting& lost : sight.lost) {
    if (lost.camera != c) continue;
    addPixel(rejected, lost.pixel);
    rejected.push_back(static_cast<int>(lost.loss));
  }
  if (c != 0) return;
  // Only camera 0 has mesh and loops.
  const LocalMesh& mesh = outlet.mesh.value();
  if (outlet.mesh.sequence() > 0 && sight.has_pose && mesh.epoch == sight.epoch) {
    json["mesh"] = meshJson(mesh, sight.T_world_cam[0]);
  }
  const LoopNews& loop = outlet.images->loop.value();
  const double since = (sight.stamp - loop.stamp).seconds();
  if (outlet.images->loop.sequence() == 0 || since < 0 || since > kLoopShown) return;
  Json matches = Json::array();
  for (const LoopNews::Match& match : loop.matches) {
    addPixel(matches, match.now);
    addPixel(matches, match.then);
  }
  json["loop"] = {{"text", fmt::format("loop closed with {:.1f} s before, {} matches",
                                       (loop.stamp - loop.old_stamp).seconds(), loop.inliers)},
                  {"matches", std::move(matches)}};
}

Json LiveImages::meshJson(const LocalMesh& mesh, const SE3& T_world_cam) const {
  const SE3 T_cam_world = T_world_cam.inverse();
  const CameraModel& lens = rig_.camera[0];
  Json vertices = Json::array();
  std::vector<int> index(mesh.vertices.size(), -1);  // index in the message; -1: not in the image
  std::vector<Eigen::Vector2d> pixels(mesh.vertices.size());
  int count = 0;
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    const Eigen::Vector3d p = T_cam_world * mesh.vertices[i].p_world.cast<double>();
    if (!lens.project(p, pixels[i]) || !lens.inImage(pixels[i])) continue;
    index[i] = count++;
    addPixel(vertices, pixels[i].cast<float>());
  }
  std::vector<std::pair<int, int>> edges;
  for (const MeshFace& face : mesh.faces) {
    const auto [a, b, c] = face.vertex;
    if (index[a] < 0 || index[b] < 0 || index[c] < 0) continue;
    const Eigen::Vector2d ab = pixels[b] - pixels[a];
    const Eigen::Vector2d ac = pixels[c] - pixels[a];
    // Faces seen from the observed side are counter-clockwise; rows go down. Others show their back.
    if (ab.x() * ac.y() - ab.y() * ac.x() > 0) continue;
    edges.emplace_back(std::minmax(index[a], index[b]));
    edges.emplace_back(std::minmax(index[b], index[c]));
    edges.emplace_back(std::minmax(index[c], index[a]));
  }
  std::ranges::sort(edges);
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  if (edges.size() > kMostMeshEdges) edges.resize(kMostMeshEdges);
  Json pairs = Json::array();
  for (const auto& [from, to] : edges) {
    pairs.push_back(from);
    pairs.push_back(to);
  }
  return {{"vertices", std::move(vertices)}, {"edges", std::move(pairs)}};
}

}  // namespace swiftlet
