#include "mapping/place/place_extractor.hpp"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "mapping/place/fast_score.hpp"

namespace swiftlet {
namespace {

// Least distance of a feature from the image border: its patch, the smoothing, one more for rounding.
constexpr int kBorder = SteeredBrief::kBorder + 1;  // px
constexpr int kMinCell = 12;                        // px: a cell's least side
// Average number of features per cell. With fewer, weak corners are taken to cover every cell; with more, the
// image is covered unevenly.
constexpr int kWantedPerCell = 3;
// Tracked features are described in one of this many octaves (up to scale 1.7), because their patches are of
// this size.
constexpr int kTrackedOctaves = 4;
// A corner this near to a described feature of the same octave is the same corner.
constexpr float kSameCorner = 3.0F;  // px of the octave

// Harris' measure of a corner over 7 x 7 pixels, from Sobel gradients: sums below 2^28, then floats.
float harris(const std::uint8_t* centre, std::ptrdiff_t stride) {
  constexpr int kRadius = 3;
  constexpr float kTrace = 0.04F;  // Harris, Stephens, 1988
  std::int32_t xx = 0, xy = 0, yy = 0;
  for (int dy = -kRadius; dy <= kRadius; ++dy) {
    const std::uint8_t* at = centre + dy * stride - kRadius;
    const std::uint8_t* up = at - stride;
    const std::uint8_t* down = at + stride;
    for (int i = 0; i < 2 * kRadius + 1; ++i) {
      const int gx = (at[i + 1] - at[i - 1]) * 2 + (up[i + 1] - up[i - 1]) + (down[i + 1] - down[i - 1]);
      const int gy = (down[i] - up[i]) * 2 + (down[i - 1] - up[i - 1]) + (down[i + 1] - up[i + 1]);
      xx += gx * gx;
      xy += gx * gy;
      yy += gy * gy;
    }
  }
  const auto a = static_cast<float>(xx), b = static_cast<float>(xy), c = static_cast<float>(yy);
  return a * c - b * b - kTrace * (a + c) * (a + c);
}

}  // namespace

PlaceExtractor::PlaceExtractor(int width, int height, const PlaceExtractorSettings& settings)
    : settings_(settings), pyramid_(width, height, settings.octaves) {
  settings_.features = std::clamp(settings_.features, 0, static_cast<int>(kMaxPlaceFeatures));
  settings_.tracked = std::clamp(settings_.tracked, 0, settings_.features);
  settings_.min_score = std::clamp(settings_.min_score, 1, 254);
  std::size_t most_cells = 1;
  for (int l = 0; l < pyramid_.octaves(); ++l) {
    const ImageView level = pyramid_.level(l);
    scores_[static_cast<std::size_t>(l)].assign(
        static_cast<std::size_t>(level.stride) * static_cast<std::size_t>(level.height + 1), 0);
    const auto cells = static_cast<std::size_t>((level.width / kMinCell + 1) * (level.height / kMinCell + 1));
    most_cells = std::max(most_cells, cells);
  }
  cells_.resize(most_cells);
  peaks_.resize(static_cast<std::size_t>(pyramid_.level(0).stride), 0);
  spots_.reserve(most_cells * kPerCell);
}

// Total order: the result does not depend on the sort's implementation.
bool PlaceExtractor::stronger(const Spot& a, const Spot& b) {
  if (a.strength != b.strength) return a.strength > b.strength;
  return a.y != b.y ? a.y < b.y : a.x < b.x;
}

bool PlaceExtractor::inside(int octave, int x, int y) const {
  const ImageView level = pyramid_.level(octave);
  return x >= kBorder && y >= kBorder && x < level.width - kBorder && y < level.height - kBorder;
}

// Number of features of an octave, in proportion to its side. Distinct corners keep a distance in pixels, so
// smaller octaves hold fewer.
int PlaceExtractor::share(int octave, int features) const {
  const double shrink = 1 / kOctaveRatio;
  const double first = features * (1 - shrink) / (1 - std::pow(shrink, pyramid_.octaves()));
  return static_cast<int>(std::lround(first * std::pow(shrink, octave)));
}

template <typename Lanes>
void PlaceExtractor::score(int octave) {
  const ImageView level = pyramid_.level(octave);
  std::vector<std::uint8_t>& out = scores_[static_cast<std::size_t>(octave)];
  const int begin = kBorder - 1;
  const int end = level.width - kBorder + 1;
  for (int y = kBorder - 1; y < level.height - kBorder + 1; ++y) {
    if (begin >= end) break;
    fastScoreRow<Lanes>(level.row(y), level.stride, begin, end,
                        static_cast<std::uint8_t>(settings_.min_score - 1),
                        out.data() + static_cast<std::ptrdiff_t>(y) * level.stride);
  }
}

// Best first; equal ones in the order of discovery.
void PlaceExtractor::keepInCell(Cell& cell, const Spot& spot) const {
  std::size_t at = cell.count;
  while (at > 0 && cell.best[at - 1].score < spot.score) --at;
  if (at == kPerCell) return;
  cell.count = std::min(cell.count + 1, kPerCell);
  for (std::size_t i = cell.count - 1; i > at; --i) cell.best[i] = cell.best[i - 1];
  cell.best[at] = spot;
}

template <typename Lanes>
void PlaceExtractor::findSpots(int octave, int wanted) {
  spots_.clear();
  const ImageView level = pyramid_.level(octave);
  const int width = level.width - 2 * kBorder;
  const int height = level.height - 2 * kBorder;
  if (width <= 0 || height <= 0 || wanted <= 0) return;
  const double area = static_cast<double>(width) * height * kWantedPerCell / wanted;
  const int side = std::max(kMinCell, static_cast<int>(std::lround(std::sqrt(area))));
  const int columns = (width + side - 1) / side;
  const int rows = (height + side - 1) / side;
  for (int c = 0; c < columns * rows; ++c) cells_[static_cast<std::size_t>(c)].count = 0;
  const std::uint8_t* scores = scores_[static_cast<std::size_t>(octave)].data();
  const int end = level.width - kBorder;
  for (int y = kBorder; y < level.height - kBorder; ++y) {
    const std::uint8_t* here = scores + static_cast<std::ptrdiff_t>(y) * level.stride;
    peaksOfRow<Lanes>(here, level.stride, kBorder, end, static_cast<std::uint8_t>(settings_.min_score),
                      peaks_.data());
    Cell* row = cells_.data() + static_cast<std::ptrdiff_t>((y - kBorder) / side) * columns;
    constexpr int kWord = 8;  // peaks are rare: check eight pixels at once
    for (int x = kBorder; x < end; x += kWord) {
      std::uint64_t eight = 0;
      std::memcpy(&eight, peaks_.data() + x, sizeof eight);
      if (eight == 0) continue;
      for (int at = x; at < std::min(x + kWord, end); ++at) {
        if (peaks_[static_cast<std::size_t>(at)] == 0) continue;
        keepInCell(row[(at - kBorder) / side],
                   {static_cast<std::int16_t>(at), static_cast<std::int16_t>(y), here[at], 0, 0});
      }
    }
  }
  orderSpots(octave, columns * rows);
}

void PlaceExtractor::orderSpots(int octave, int cells) {
  const ImageView level = pyramid_.level(octave);
  for (int c = 0; c < cells; ++c) {
    Cell& cell = cells_[static_cast<std::size_t>(c)];
    for (std::size_t i = 0; i < cell.count; ++i) {
      Spot& spot = cell.best[i];
      spot.strength = harris(level.row(spot.y) + spot.x, level.stride);
    }
    std::sort(cell.best.begin(), cell.best.begin() + static_cast<std::ptrdiff_t>(cell.count), stronger);
    for (std::size_t i = 0; i < cell.count; ++i) {
      cell.best[i].rank = static_cast<std::uint8_t>(i);
      spots_.push_back(cell.best[i]);
    }
  }
  std::sort(spots_.begin(), spots_.end(), [](const Spot& a, const Spot& b) {
    if (a.rank != b.rank) return a.rank < b.rank;
    return stronger(a, b);
  });
}

bool PlaceExtractor::add(int octave, int x, int y, const Eigen::Vector2f& pixel, const CameraModel& camera,
                         PlaceKeyframe& keyframe) const {
  Eigen::Vector3d bearing;
  if (!camera.unproject(pixel.cast<double>(), bearing)) return false;
  PlaceFeature feature;
  feature.pixel = pixel;
  feature.bearing = bearing.cast<float>();
  feature.octave = static_cast<std::int8_t>(octave);
  const ImageView level = pyramid_.level(octave);
  SteeredBrief::Patch patch;
  SteeredBrief::smooth(level.row(y) + x, level.stride, patch);
  feature.descriptor = brief_.describe(patch, SteeredBrief::direction(patch));
  return keyframe.features.tryPushBack(feature);
}

std::uint8_t PlaceExtractor::scoreNear(int octave, int x, int y) const {
  const int stride = pyramid_.level(octave).stride;
  const std::uint8_t* at =
      scores_[static_cast<std::size_t>(octave)].data() + static_cast<std::ptrdiff_t>(y) * stride + x;
  std::uint8_t best = 0;
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) best = std::max(best, at[dy * stride + dx]);
  }
  return best;
}

void PlaceExtractor::addTracked(const CameraModel& camera, const TrackedFrame& tracked,
                                PlaceKeyframe& keyframe) {
  const auto most = static_cast<std::size_t>(settings_.tracked);
  for (const TrackedFeature& track : tracked.features) {
    if (keyframe.features.size() >= most) return;
    const Eigen::Vector2f& pixel = track.pixel[0];
    if (!track.seen[0] || !pixel.allFinite()) continue;
    int octave = -1, x = 0, y = 0, best = -1;
    for (int l = 0; l < std::min(kTrackedOctaves, pyramid_.octaves()); ++l) {
      const Eigen::Vector2f at = pyramid_.toLevel(l, pixel);
      const auto px = static_cast<int>(std::lround(at.x()));
      const auto py = static_cast<int>(std::lround(at.y()));
      if (!inside(l, px, py)) continue;
      const int s = scoreNear(l, px, py);
      if (s <= best) continue;
      octave = l;
      x = px;
      y = py;
      best = s;
    }
    if (octave < 0 || !add(octave, x, y, pixel, camera, keyframe)) continue;
    keyframe.features.back().has_landmark = true;
    keyframe.features.back().landmark = track.id;
  }
}

void PlaceExtractor::addCorners(int octave, int wanted, const CameraModel& camera, PlaceKeyframe& keyframe) {
  const std::size_t given = keyframe.features.size();
  int taken = 0;
  for (const Spot& spot : spots_) {
    if (taken >= wanted || keyframe.features.full()) return;
    const Eigen::Vector2f pixel =
        pyramid_.toImage(octave, Eigen::Vector2f(static_cast<float>(spot.x), static_cast<float>(spot.y)));
    bool known = false;
    for (std::size_t i = 0; i < given && !known; ++i) {
      const PlaceFeature& f = keyframe.features[i];
      if (f.octave != octave || !f.has_landmark) continue;
      const Eigen::Vector2f at = pyramid_.toLevel(octave, f.pixel);
      known = std::abs(at.x() - static_cast<float>(spot.x)) < kSameCorner &&
              std::abs(at.y() - static_cast<float>(spot.y)) < kSameCorner;
    }
    if (!known && add(octave, spot.x, spot.y, pixel, camera, keyframe)) ++taken;
  }
}

template <typename Lanes>
Status PlaceExtractor::extract(const ImageView& image, const CameraModel& camera, const TrackedFrame& tracked,
                               PlaceKeyframe& keyframe) {
  keyframe.features.clear();
  keyframe.index = tracked.index;
  keyframe.stamp = tracked.stamp;
  if (!pyramid_.build<typename Lanes::Isa>(image))
    return {StatusCode::kInvalidInput, "place recognition received an image of another size"};
  for (int l = 0; l < pyramid_.octaves(); ++l) score<Lanes>(l);
  addTracked(camera, tracked, keyframe);
  const int corners = settings_.features - static_cast<int>(keyframe.features.size());
  // Smallest octave first. Features that an octave cannot provide are taken from the next one.
  int due = 0;
  for (int l = pyramid_.octaves() - 1; l >= 0; --l) {
    due += share(l, corners);
    if (l == 0) due = settings_.features - static_cast<int>(keyframe.features.size());
    const std::size_t before = keyframe.features.size();
    findSpots<Lanes>(l, due);
    addCorners(l, due, camera, keyframe);
    due -= static_cast<int>(keyframe.features.size() - before);
  }
  if (keyframe.features.empty()) return {StatusCode::kDegenerate, "no corner in the keyframe's image"};
  return okStatus();
}

template Status PlaceExtractor::extract<byte_lanes::Native>(const ImageView&, const CameraModel&,
                                                            const TrackedFrame&, PlaceKeyframe&);
template Status PlaceExtractor::extract<byte_lanes::Scalar>(const ImageView&, const CameraModel&,
                                                            const TrackedFrame&, PlaceKeyframe&);

}  // namespace swiftlet
