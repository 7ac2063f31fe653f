#include "firmware_host/lab/report/run_moments.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <exception>
#include <limits>
#include <numeric>

#include "drivers/input/input_error.hpp"
#include "firmware_host/outputs/page/base64.hpp"
#include "firmware_host/outputs/page/surface_json.hpp"

namespace swiftlet {
namespace {

// Longest difference between stamps of one image in different files: text in seconds keeps nanoseconds, but
// other tools may not.
constexpr Duration kSameImage{10'000};

constexpr int kFollowed = 0;  // kind of a track in the image panel's message; the file does not give it

/// A tenth of a pixel is enough for display.
void addPixel(nlohmann::ordered_json& list, double x, double y) {
  list.push_back(std::round(10 * x) / 10);
  list.push_back(std::round(10 * y) / 10);
}

}  // namespace

RunMoments::RunMoments(const RunFiles& files, const std::string& log)
    : first_(files.first_image), poses_(files.odometry) {
  try {
    const bool mono = files.number("run/cameras") == 1;
    images_ = std::make_unique<LogImages>(log.empty() ? logOf(files) : log, mono, files.first_image,
                                          files.last_image);
    stamps_ = images_->stamps(0);
  } catch (const std::exception& error) {
    missing_.push_back({"images", error.what()});
    for (const TrajectoryPoint& point : poses_) stamps_.push_back(point.stamp);
  }
  for (const StoredState& state : files.states) keyframes_.push_back(state.stamp);
  kept_ = readKeptFrames(files.folder, missing_);
}

bool RunMoments::isKeyframe(Stamp stamp) const {
  return kept_.keyframeAt(stamp) != nullptr || std::ranges::binary_search(keyframes_, stamp);
}

const Rig* RunMoments::rig() const {
  if (kept_.rig) return &*kept_.rig;
  return images_ == nullptr ? nullptr : images_->rig();
}

std::optional<SE3> RunMoments::poseAt(Stamp stamp) const {
  const auto found = std::ranges::lower_bound(poses_, stamp - kSameImage, {}, &TrajectoryPoint::stamp);
  if (found == poses_.end() || found->stamp > stamp + kSameImage) return {};
  return found->T_world_body;
}

std::vector<std::size_t> RunMoments::spread(std::size_t most) const {
  std::vector<std::size_t> from;
  for (std::size_t i = 0; i < stamps_.size(); ++i) {
    if (isKeyframe(stamps_[i])) from.push_back(i);
  }
  if (from.empty()) {
    from.resize(stamps_.size());
    std::iota(from.begin(), from.end(), std::size_t{0});
  }
  if (from.size() <= most) return from;
  std::vector<std::size_t> chosen;
  // From the middle of equal parts: the first image has no tracks yet.
  for (std::size_t k = 0; k < most; ++k) chosen.push_back(from[(2 * k + 1) * from.size() / (2 * most)]);
  return chosen;
}

/// Reduces the quality until the picture is small enough; empty if that is not possible.
std::string RunMoments::pictureText(const ImageView& image, const PictureBounds& bounds) {
  constexpr std::array kQualities = {80, 60, 40, 20};  // of JPEG
  for (const int quality : kQualities) {
    std::string text = coder_.encode(image, {bounds.most_width, quality});
    if (text.size() <= bounds.most_bytes) return text;
  }
  return {};
}

nlohmann::ordered_json RunMoments::camerasJson() const {
  Json cameras = Json::array();
  for (std::size_t c = 0; images_ != nullptr && c < images_->cameras(); ++c) {
    cameras.push_back({{"width", images_->lens(c).width()}, {"height", images_->lens(c).height()}});
  }
  return cameras;
}

nlohmann::ordered_json RunMoments::playbackJson(std::span<const std::size_t> moments) const {
  std::vector<float> t;
  std::vector<float> poses;
  std::vector<std::uint8_t> keyframes;
  for (const std::size_t moment : moments) {
    const Stamp stamp = stamps_[moment];
    t.push_back(static_cast<float>((stamp - first_).seconds()));
    keyframes.push_back(isKeyframe(stamp) ? 1 : 0);
    const std::optional<SE3> pose = poseAt(stamp);
    constexpr float kNone = std::numeric_limits<float>::quiet_NaN();
    for (int i = 0; i < 3; ++i) {
      poses.push_back(pose ? static_cast<float>(pose->translation[i]) : kNone);
    }
    for (int i = 0; i < 4; ++i) {
      poses.push_back(pose ? static_cast<float>(pose->rotation.coeffs()[i]) : kNone);
    }
  }
  return {{"count", t.size()},
          {"t", base64Of(std::span<const float>(t))},
          {"poses", base64Of(std::span<const float>(poses))},
          {"keyframes", base64Of(std::span<const std::uint8_t>(keyframes))}};
}

nlohmann::ordered_json RunMoments::message(std::size_t moment, const PictureBounds& bounds) {
  const Stamp stamp = stamps_[moment];
  std::optional<TriangleMesh> mesh;
  try {
    mesh = kept_.meshAt(stamp);
  } catch (const InputError&) {
    // Damaged: treated as missing.
  }
  Json message = {{"t", (stamp - first_).seconds()},
                  {"frame", moment},
                  {"keyframe", isKeyframe(stamp)},
                  {"cameras", Json::array()}};
  for (std::size_t c = 0; images_ != nullptr && c < images_->cameras(); ++c) {
    message["cameras"].push_back(cameraJson(stamp, c, mesh, bounds));
  }
  if (mesh && !mesh->vertices.empty()) {
    message["scene"] = {{"surfaces", {surfaceJson("local_mesh", "local mesh", *mesh)}}};
  }
  return message;
}

nlohmann::ordered_json RunMoments::cameraJson(Stamp stamp, std::size_t camera,
                                              const std::optional<TriangleMesh>& mesh,
                                              const PictureBounds& bounds) {
  const std::string picture = pictureText(images_->at(stamp, camera), bounds);
  if (picture.empty()) return nullptr;
  Json json = {{"src", picture}};
  if (const KeptKeyframe* keyframe = kept_.keyframeAt(stamp)) json["tracks"] = tracksJson(*keyframe, camera);
  if (const LoopRevisit* loop = kept_.loopAt(stamp)) json["loop"] = loopJson(*loop, camera);
  const std::optional<SE3> pose = poseAt(stamp);
  if (mesh && pose && rig() != nullptr && camera < rig()->camera_count)
    json["mesh"] = meshJson(*mesh, *pose, camera);
  return json;
}

nlohmann::ordered_json RunMoments::tracksJson(const KeptKeyframe& keyframe, std::size_t camera) const {
  Json tracks = Json::array();
  for (const TrackedFeature& feature : keyframe.features) {
    if (!feature.seen[camera]) continue;
    tracks.push_back(feature.id);
    addPixel(tracks, feature.pixel[camera].x(), feature.pixel[camera].y());
    tracks.push_back(kFollowed);
  }
  return tracks;
}

nlohmann::ordered_json RunMoments::loopJson(const LoopRevisit& loop, std::size_t camera) const {
  // A match gives a track, pixels, or both.
  const auto pixelOf = [&](const RevisitFeature& feature, Stamp stamp) -> std::optional<Eigen::Vector2f> {
    if (feature.seen[camera]) return feature.pixel[camera];
    const KeptKeyframe* keyframe = feature.has_track ? kept_.keyframeAt(stamp) : nullptr;
    if (keyframe == nullptr) return {};
    const auto found = std::ranges::lower_bound(keyframe->features, feature.track, {}, &TrackedFeature::id);
    if (found == keyframe->features.end() || found->id != feature.track || !found->seen[camera]) return {};
    return found->pixel[camera];
  };
  Json matches = Json::array();
  for (const RevisitMatch& match : loop.matches) {
    const auto now = pixelOf(match.new_feature, loop.new_stamp);
    const auto then = pixelOf(match.old_feature, loop.old_stamp);
    if (!now || !then) continue;
    addPixel(matches, now->x(), now->y());
    addPixel(matches, then->x(), then->y());
  }
  return {{"text", fmt::format("loop closure with {:.2f} s, {} matches", (loop.old_stamp - first_).seconds(),
                               loop.matches.size())},
          {"matches", matches}};
}

nlohmann::ordered_json RunMoments::meshJson(const TriangleMesh& mesh, const SE3& T_world_body,
                                            std::size_t camera) const {
  const SE3 T_cam_world = (T_world_body * rig()->T_body_cam[camera]).inverse();
  std::vector<std::optional<std::size_t>> index(mesh.vertices.size());  // among those in the image
  Json vertices = Json::array();
  const CameraModel& lens = rig()->camera[camera];
  for (std::size_t i = 0; i < mesh.vertices.size(); ++i) {
    Eigen::Vector2d pixel;
    if (!lens.project(T_cam_world * mesh.vertices[i].cast<double>(), pixel)) continue;
    if (pixel.x() < 0 || pixel.y() < 0 || pixel.x() > lens.width() - 1 || pixel.y() > lens.height() - 1) {
      continue;
    }
    index[i] = vertices.size() / 2;
    addPixel(vertices, pixel.x(), pixel.y());
  }
  std::vector<std::array<std::size_t, 2>> edges;
  for (const auto& face : mesh.faces) {
    for (std::size_t k = 0; k < 3; ++k) {
      const auto a = index[face[k]];
      const auto b = index[face[(k + 1) % 3]];
      if (a && b) edges.push_back({std::min(*a, *b), std::max(*a, *b)});
    }
  }
  std::ranges::sort(edges);
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  Json flat = Json::array();
  for (const auto& edge : edges) {
    for (const std::size_t end : edge) flat.push_back(end);
  }
  return {{"vertices", vertices}, {"edges", flat}};
}

nlohmann::ordered_json servedMoments(const RunMoments& moments, const std::string& source) {
  std::vector<std::size_t> all(moments.count());
  std::iota(all.begin(), all.end(), std::size_t{0});
  nlohmann::ordered_json json = {{"cameras", moments.camerasJson()}, {"playback", moments.playbackJson(all)}};
  json["playback"]["source"] = source;
  return json;
}

nlohmann::ordered_json embeddedMoments(RunMoments& moments, std::size_t most_bytes) {
  if (!moments.hasImages()) return nullptr;
  constexpr std::size_t kHandful = 6;
  constexpr int kWidth = 480;  // px, maximum: half of a usual image's width
  const std::vector<std::size_t> chosen = moments.spread(kHandful);
  nlohmann::ordered_json json = {{"cameras", moments.camerasJson()},
                                 {"playback", moments.playbackJson(chosen)}};
  const PictureBounds bounds{kWidth, most_bytes / (kHandful * json["cameras"].size())};
  json["playback"]["messages"] = nlohmann::ordered_json::array();
  for (const std::size_t moment : chosen) {
    json["playback"]["messages"].push_back(moments.message(moment, bounds));
  }
  return json;
}

}  // namespace swiftlet
