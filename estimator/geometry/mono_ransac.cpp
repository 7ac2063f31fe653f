#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "estimator/core/random.hpp"
#include "estimator/geometry/consensus.hpp"
#include "estimator/geometry/minimal_solvers.hpp"
#include "estimator/geometry/ransac.hpp"
#include "estimator/geometry/so3.hpp"

namespace swiftlet {
namespace {

// 3 sigma of a normal error in one direction; below, the gate with the same probability in two directions.
constexpr double kGateSigmas = 3.0;
constexpr double kGateSquared = kGateSigmas * kGateSigmas;
constexpr double kGateSquaredTwoDof = 11.83;
// A motion must explain more tracks than a pure rotation does: by this share of its own inliers, and by this
// share of the tracks that the rotation does not explain, of which about 0.1 fit by chance.
constexpr double kExtraInliers = 0.05;
constexpr double kExtraOfUnexplained = 0.15;
constexpr int kRefineSteps = 3;
constexpr int kFinalRefineSteps = 6;
// Stop after a step that reduces the cost by less than this share.
constexpr double kSettled = 1e-3;
constexpr int kMaxRotationSamples = 60;
constexpr std::size_t kLanes = 8;
// Number of tracks after which the cost of a hypothesis is compared with the best.
constexpr std::size_t kCostBlock = 64;
// Keeps divisions finite for a bearing at the epipole; far below any noise squared.
constexpr double kTiny = 1e-24;

struct Gates {
  double sampson_squared;  // [rad^2]
  double parallax;         // [rad] noise of a parallax
  double min_depth;        // over the baseline
  double turned_squared;   // [rad^2] |cur - R prev|^2
  double inverse_variance;

  explicit Gates(const RansacSettings& settings)
      : sampson_squared(kGateSquared * settings.bearing_sigma * settings.bearing_sigma),
        parallax(kGateSigmas * std::numbers::sqrt2 * settings.bearing_sigma),
        min_depth(settings.min_depth_over_baseline),
        turned_squared(2.0 * kGateSquaredTwoDof * settings.bearing_sigma * settings.bearing_sigma),
        inverse_variance(1.0 / (settings.bearing_sigma * settings.bearing_sigma)) {}
};

struct Model {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  Eigen::Vector3d t = Eigen::Vector3d::Zero();            // unit, or zero: rotation alone
  double cost = std::numeric_limits<double>::infinity();  // truncated, in gates
  std::size_t inliers = 0;

  [[nodiscard]] bool turnsOnly() const { return t.isZero(0); }
};

Status load(Bearings prev, Bearings cur, const RansacSettings& settings, MonoTracks& tracks,
            RansacResult& result) {
  result = RansacResult{};
  tracks.count = 0;
  if (prev.size() != cur.size() || prev.size() > kMaxFeatures) {
    return {StatusCode::kInvalidInput, "ransac: track counts differ or exceed kMaxFeatures"};
  }
  if (!settings.valid()) return {StatusCode::kInvalidInput, "ransac: a setting is out of range"};
  result.inlier.resize(prev.size());
  for (std::size_t i = 0; i < prev.size(); ++i) {
    result.inlier[i] = false;
    if (!prev[i].allFinite() || !cur[i].allFinite()) continue;
    const std::size_t at = tracks.count++;
    tracks.prev.x[at] = prev[i].x();
    tracks.prev.y[at] = prev[i].y();
    tracks.prev.z[at] = prev[i].z();
    tracks.cur.x[at] = cur[i].x();
    tracks.cur.y[at] = cur[i].y();
    tracks.cur.z[at] = cur[i].z();
    tracks.index[at] = i;
  }
  return okStatus();
}

// Truncated sum of squared Sampson errors over the gate; stops once above `bound`.
double essentialCost(const Eigen::Matrix3d& E, const MonoTracks& tracks, double gate_squared, double bound) {
  const double inverse_gate = 1.0 / gate_squared;
  const double e00 = E(0, 0), e01 = E(0, 1), e02 = E(0, 2);
  const double e10 = E(1, 0), e11 = E(1, 1), e12 = E(1, 2);
  const double e20 = E(2, 0), e21 = E(2, 1), e22 = E(2, 2);
  const auto& p = tracks.prev;
  const auto& c = tracks.cur;
  const auto term = [&](std::size_t i) {
    const double nx = e00 * p.x[i] + e01 * p.y[i] + e02 * p.z[i];
    const double ny = e10 * p.x[i] + e11 * p.y[i] + e12 * p.z[i];
    const double nz = e20 * p.x[i] + e21 * p.y[i] + e22 * p.z[i];
    const double mx = e00 * c.x[i] + e10 * c.y[i] + e20 * c.z[i];
    const double my = e01 * c.x[i] + e11 * c.y[i] + e21 * c.z[i];
    const double mz = e02 * c.x[i] + e12 * c.y[i] + e22 * c.z[i];
    const double e = nx * c.x[i] + ny * c.y[i] + nz * c.z[i];
    const double gradient = nx * nx + ny * ny + nz * nz + mx * mx + my * my + mz * mz + kTiny;
    const double error = e * e * inverse_gate / gradient;
    return error < 1.0 ? error : 1.0;
  };
  double cost = 0;
  std::size_t i = 0;
  while (i + kLanes <= tracks.count) {
    const std::size_t end = std::min(tracks.count, i + kCostBlock);
    std::array<double, kLanes> sums{};
    for (; i + kLanes <= end; i += kLanes) {
      for (std::size_t lane = 0; lane < kLanes; ++lane) sums[lane] += term(i + lane);
    }
    for (const double sum : sums) cost += sum;
    if (cost > bound) return cost;
  }
  for (; i < tracks.count; ++i) cost += term(i);
  return cost;
}

// Four tracks at a time.
using Lanes = Eigen::Array4d;
constexpr std::size_t kRayLanes = 4;
static_assert(kMaxFeatures % kRayLanes == 0);

struct Rays {
  Lanes x, y, z;

  static Rays of(const MonoTracks::Coordinates& c, std::size_t i) {
    return {Lanes::Map(&c.x[i]), Lanes::Map(&c.y[i]), Lanes::Map(&c.z[i])};
  }
  static Rays of(const Eigen::Vector3d& v) {
    return {Lanes::Constant(v.x()), Lanes::Constant(v.y()), Lanes::Constant(v.z())};
  }
};

Rays operator*(const Eigen::Matrix3d& R, const Rays& v) {
  return {R(0, 0) * v.x + R(0, 1) * v.y + R(0, 2) * v.z, R(1, 0) * v.x + R(1, 1) * v.y + R(1, 2) * v.z,
          R(2, 0) * v.x + R(2, 1) * v.y + R(2, 2) * v.z};
}
Rays operator-(const Rays& a, const Rays& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
Rays cross(const Rays& a, const Rays& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
Lanes dot(const Rays& a, const Rays& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

/// One per track, in complete lanes: values after the last track are undefined.
using Errors = std::array<double, kMaxFeatures>;

// Squared errors over the gate of all tracks under a motion; 1 or more: outlier.
void gatedErrors(const Model& model, const MonoTracks& tracks, const Gates& gates, Errors& errors) {
  const bool turns_only = model.turnsOnly();
  const Rays t = Rays::of(model.t);
  for (std::size_t i = 0; i < tracks.count; i += kRayLanes) {
    const Rays cur = Rays::of(tracks.cur, i);
    const Rays turned = model.R * Rays::of(tracks.prev, i);
    if (turns_only) {
      const Rays difference = cur - turned;
      Lanes::Map(&errors[i]) = dot(difference, difference) / gates.turned_squared;
      continue;
    }
    const Rays normal = cross(t, turned);  // of the epipolar plane
    const Rays cur_normal = cross(t, cur);
    const Lanes e = dot(normal, cur);
    const Lanes normal_squared = dot(normal, normal);
    const Lanes error =
        e * e / (gates.sampson_squared * (normal_squared + dot(cur_normal, cur_normal) + kTiny));
    // With depths d' cur = d turned + t: d' and d are positive multiples of `towards` and `from`, and d / |t|
    // = from / towards. Both are sines times |normal|, with the noise of the parallax gate.
    const Lanes slack = gates.parallax * normal_squared.sqrt();
    const Lanes towards = dot(cur, cross(turned, normal));
    const Lanes from = dot(normal, cur_normal) + slack;
    const Lanes in_front =
        (towards + slack).min(from).min(dot(cur, turned)).min(from - gates.min_depth * towards);
    for (std::size_t k = 0; k < kRayLanes; ++k) {
      const auto lane = static_cast<Eigen::Index>(k);
      errors[i + k] = in_front[lane] > 0 ? error[lane] : std::max(error[lane], 1.0);
    }
  }
}

// Prior of the rotation. Information zero: free; infinite: fixed.
struct RotationPrior {
  Eigen::Matrix3d R = Eigen::Matrix3d::Identity();
  double information = 0;  // [1/rad^2]

  [[nodiscard]] bool fixes() const { return std::isinf(information); }
  [[nodiscard]] bool pulls() const { return information > 0 && !fixes(); }
};

void score(const MonoTracks& tracks, const Gates& gates, const RotationPrior& prior, Model& model) {
  model.cost = 0;
  if (prior.pulls()) {
    model.cost = prior.information * logSo3(Eigen::Matrix3d(prior.R.transpose() * model.R)).squaredNorm() /
                 kGateSquared;
  }
  model.inliers = 0;
  Errors errors;
  gatedErrors(model, tracks, gates, errors);
  for (std::size_t i = 0; i < tracks.count; ++i) {
    model.cost += std::min(errors[i], 1.0);
    model.inliers += errors[i] < 1.0 ? 1 : 0;
  }
}

void addPrior(const RotationPrior& prior, const Eigen::Matrix3d& R, Eigen::Ref<Eigen::Matrix3d> H,
              Eigen::Ref<Eigen::Vector3d> g) {
  if (!prior.pulls()) return;
  const Eigen::Matrix3d difference = prior.R.transpose() * R;
  g += prior.information * logSo3(difference);
  H.diagonal().array() += prior.information;
}

// One Gauss-Newton step of a pure rotation: cur - R Exp(phi) prev.
Model stepRotation(const MonoTracks& tracks, const Gates& gates, const RotationPrior& prior,
                   const Model& model) {
  Eigen::Matrix3d H = Eigen::Matrix3d::Zero();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
  const double weight = 0.5 * gates.inverse_variance;  // both bearings are noisy
  for (std::size_t i = 0; i < tracks.count; ++i) {
    const Eigen::Vector3d prev = tracks.prevAt(i);
    const Eigen::Vector3d cur = tracks.curAt(i);
    if ((cur - model.R * prev).squaredNorm() >= gates.turned_squared) continue;
    const Eigen::Vector3d back = model.R.transpose() * cur;
    H += weight * (Eigen::Matrix3d::Identity() - prev * prev.transpose());
    g += weight * back.cross(prev);
  }
  addPrior(prior, model.R, H, g);
  Model next = model;
  next.R = model.R * expSo3Matrix(-H.ldlt().solve(g));
  return next;
}

// One Gauss-Newton step of rotation and direction of translation on the Sampson errors of the inliers. The
// lengths of their gradients are held constant (their change is second order in the errors).
Model stepMotion(const MonoTracks& tracks, const Gates& gates, const RotationPrior& prior,
                 const Model& model) {
  using Vector5d = Eigen::Matrix<double, 5, 1>;
  using Matrix5d = Eigen::Matrix<double, 5, 5>;
  const Eigen::Vector3d axis = model.t.unitOrthogonal();
  Eigen::Matrix<double, 3, 2> tangent;
  tangent << axis, model.t.cross(axis);
  Errors errors;
  gatedErrors(model, tracks, gates, errors);
  std::array<std::array<Lanes, 5>, 5> products;
  std::array<Lanes, 5> gradients;
  for (std::size_t a = 0; a < 5; ++a) {
    gradients[a].setZero();
    for (std::size_t b = 0; b <= a; ++b) products[a][b].setZero();
  }
  const Eigen::Matrix3d R_back = model.R.transpose();
  const Rays t = Rays::of(model.t);
  const std::array<Rays, 2> tangents{Rays::of(tangent.col(0)), Rays::of(tangent.col(1))};
  for (std::size_t i = 0; i < tracks.count; i += kRayLanes) {
    const Rays prev = Rays::of(tracks.prev, i);
    const Rays cur = Rays::of(tracks.cur, i);
    const Rays turned = model.R * prev;
    const Rays normal = cross(t, turned);
    const Rays cur_normal = cross(cur, t);
    const Rays along = cross(turned, cur);
    const Rays turns = cross(prev, R_back * cur_normal);
    const std::array<Lanes, 5> J{turns.x, turns.y, turns.z, dot(tangents[0], along), dot(tangents[1], along)};
    const Lanes gradient = dot(normal, normal) + dot(cur_normal, cur_normal) + kTiny;
    Lanes weight;
    for (std::size_t k = 0; k < kRayLanes; ++k) {
      const auto lane = static_cast<Eigen::Index>(k);
      const bool used = i + k < tracks.count && errors[i + k] < 1.0;
      weight[lane] = used ? gates.inverse_variance / gradient[lane] : 0.0;
    }
    const Lanes residual = dot(t, along);
    for (std::size_t a = 0; a < 5; ++a) {
      const Lanes weighted = weight * J[a];
      gradients[a] += weighted * residual;
      for (std::size_t b = 0; b <= a; ++b) products[a][b] += weighted * J[b];
    }
  }
  Matrix5d H;
  Vector5d g;
  for (std::size_t a = 0; a < 5; ++a) {
    const auto row = static_cast<Eigen::Index>(a);
    g[row] = gradients[a].sum();
    for (std::size_t b = 0; b <= a; ++b) {
      const auto column = static_cast<Eigen::Index>(b);
      H(row, column) = H(column, row) = products[a][b].sum();
    }
  }
  addPrior(prior, model.R, H.topLeftCorner<3, 3>(), g.head<3>());
  Vector5d step = Vector5d::Zero();
  if (prior.fixes()) {
    step.tail<2>() = -H.bottomRightCorner<2, 2>().ldlt().solve(g.tail<2>());
  } else {
    step = -H.ldlt().solve(g);
  }
  Model next = model;
  next.R = model.R * expSo3Matrix(step.head<3>());
  next.t = (model.t + tangent * step.tail<2>()).normalized();
  return next;
}

// Iterates while the truncated cost decreases.
void refine(const MonoTracks& tracks, const Gates& gates, const RotationPrior& prior, int steps,
            Model& model) {
  if (model.turnsOnly() && prior.fixes()) return;
  for (int i = 0; i < steps; ++i) {
    Model next = model.turnsOnly() ? stepRotation(tracks, gates, prior, model)
                                   : stepMotion(tracks, gates, prior, model);
    if (!next.R.allFinite() || !next.t.allFinite()) return;
    score(tracks, gates, prior, next);
    if (!(next.cost < model.cost)) return;
    const bool settled = next.cost > (1.0 - kSettled) * model.cost;
    model = next;
    if (settled) return;
  }
}

Model rotationConsensus(const MonoTracks& tracks, const Gates& gates, const RansacSettings& settings,
                        Random& random) {
  Model best;
  score(tracks, gates, {}, best);
  int needed = kMaxRotationSamples;
  for (int i = 0; i < needed; ++i) {
    const auto sample = drawSample<2>(random, tracks.count);
    Model model;
    model.R = rotationFromTwoPoints(std::array{tracks.prevAt(sample[0]), tracks.prevAt(sample[1])},
                                    std::array{tracks.curAt(sample[0]), tracks.curAt(sample[1])});
    score(tracks, gates, {}, model);
    if (!(model.cost < best.cost)) continue;
    refine(tracks, gates, {}, kRefineSteps, model);
    best = model;
    needed = samplesNeeded(best.inliers, tracks.count, 2, settings.confidence, kMaxRotationSamples);
  }
  return best;
}

// The best of the four motions of an essential matrix, with all gates.
Model motionOf(const Eigen::Matrix3d& E, const MonoTracks& tracks, const Gates& gates) {
  const EssentialMotions motions = motionsOfEssential(E);
  Model best;
  for (const Eigen::Matrix3d& R : motions.R) {
    for (const double sign : {1.0, -1.0}) {
      Model model;
      model.R = R;
      model.t = sign * motions.t;
      score(tracks, gates, {}, model);
      if (model.cost < best.cost) best = model;
    }
  }
  return best;
}

bool explainsMore(const Model& motion, const Model& rotation, std::size_t count) {
  const double extra = static_cast<double>(motion.inliers) - static_cast<double>(rotation.inliers);
  const auto unexplained = static_cast<double>(count - rotation.inliers);
  return extra > kExtraInliers * static_cast<double>(motion.inliers) &&
         extra > kExtraOfUnexplained * unexplained;
}

Status finish(const MonoTracks& tracks, const Gates& gates, const RansacSettings& settings,
              const RotationPrior& prior, Model& motion, Model& rotation, RansacResult& result) {
  refine(tracks, gates, prior, kFinalRefineSteps, rotation);
  refine(tracks, gates, prior, kFinalRefineSteps, motion);
  result.no_parallax = !explainsMore(motion, rotation, tracks.count);
  const Model& chosen = result.no_parallax ? rotation : motion;
  if (chosen.inliers < settings.min_inliers) {
    result.no_parallax = false;
    return {StatusCode::kDegenerate, "mono ransac: too few tracks agree on a motion"};
  }
  result.T_cur_prev = SE3(chosen.R, chosen.t);
  result.inlier_count = chosen.inliers;
  Errors errors;
  gatedErrors(chosen, tracks, gates, errors);
  for (std::size_t i = 0; i < tracks.count; ++i) result.inlier[tracks.index[i]] = errors[i] < 1.0;
  if (!result.no_parallax) return okStatus();
  return {StatusCode::kDegenerate, "mono ransac: no parallax, a rotation alone explains the tracks"};
}

Status tooFew() { return {StatusCode::kDegenerate, "ransac: fewer tracks than a sample needs"}; }

}  // namespace

Status MonoRansac::fivePoint(Bearings prev, Bearings cur, std::uint64_t seed, RansacResult& result) {
  const Status loaded = load(prev, cur, settings_, tracks_, result);
  if (!loaded.ok()) return loaded;
  if (tracks_.count < 5) return tooFew();
  const Gates gates(settings_);
  Random random(seed);
  Model rotation = rotationConsensus(tracks_, gates, settings_, random);
  Model best;
  int needed = settings_.max_iterations;
  for (; result.iterations < needed; ++result.iterations) {
    const auto sample = drawSample<5>(random, tracks_.count);
    std::array<Eigen::Vector3d, 5> from;
    std::array<Eigen::Vector3d, 5> to;
    for (std::size_t i = 0; i < 5; ++i) {
      from[i] = tracks_.prevAt(sample[i]);
      to[i] = tracks_.curAt(sample[i]);
    }
    for (const Eigen::Matrix3d& E : essentialFromFivePoints(from, to)) {
      // The other gates only increase this cost, so a worse one cannot win.
      if (!(essentialCost(E, tracks_, gates.sampson_squared, best.cost) < best.cost)) continue;
      Model model = motionOf(E, tracks_, gates);
      if (!(model.cost < best.cost)) continue;
      refine(tracks_, gates, {}, kRefineSteps, model);
      best = model;
      needed = samplesNeeded(best.inliers, tracks_.count, 5, settings_.confidence, settings_.max_iterations);
    }
  }
  return finish(tracks_, gates, settings_, {}, best, rotation, result);
}

Status MonoRansac::twoPoint(Bearings prev, Bearings cur, const Eigen::Quaterniond& R_cur_prev,
                            std::uint64_t seed, RansacResult& result) {
  const Status loaded = load(prev, cur, settings_, tracks_, result);
  if (!loaded.ok()) return loaded;
  if (!R_cur_prev.coeffs().allFinite()) {
    return {StatusCode::kInvalidInput, "ransac: the given rotation is not finite"};
  }
  if (tracks_.count < 2) return tooFew();
  const Gates gates(settings_);
  Random random(seed);
  RotationPrior prior;
  prior.R = R_cur_prev.normalized().toRotationMatrix();
  prior.information = 1.0 / (settings_.rotation_sigma * settings_.rotation_sigma);  // infinite: fixed
  Model rotation;
  rotation.R = prior.R;
  score(tracks_, gates, prior, rotation);

  // Only tracks that moved by more than their noise determine a direction.
  std::array<std::size_t, kMaxFeatures> moved{};
  std::size_t moved_count = 0;
  Errors errors;
  gatedErrors(rotation, tracks_, gates, errors);
  for (std::size_t i = 0; i < tracks_.count; ++i) {
    if (errors[i] >= 1.0) moved[moved_count++] = i;
  }
  Model best;
  int needed = moved_count < 2 ? 0 : settings_.max_iterations;
  for (; result.iterations < needed; ++result.iterations) {
    const auto sample = drawSample<2>(random, moved_count);
    const std::size_t a = moved[sample[0]];
    const std::size_t b = moved[sample[1]];
    Model model;
    model.R = prior.R;
    model.t = translationFromTwoPoints(model.R, std::array{tracks_.prevAt(a), tracks_.prevAt(b)},
                                       std::array{tracks_.curAt(a), tracks_.curAt(b)});
    if (model.turnsOnly()) continue;
    score(tracks_, gates, prior, model);
    if (!(model.cost < best.cost)) continue;
    refine(tracks_, gates, prior, kRefineSteps, model);
    best = model;
    gatedErrors(best, tracks_, gates, errors);
    std::size_t agree = 0;
    for (std::size_t i = 0; i < moved_count; ++i) agree += errors[moved[i]] < 1.0 ? 1 : 0;
    needed = samplesNeeded(agree, moved_count, 2, settings_.confidence, settings_.max_iterations);
  }
  return finish(tracks_, gates, settings_, prior, best, rotation, result);
}

}  // namespace swiftlet
