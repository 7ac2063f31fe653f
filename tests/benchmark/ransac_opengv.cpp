#include "tests/benchmark/ransac_opengv.hpp"

#include <ctime>
#include <memory>
#include <opengv/relative_pose/CentralRelativeAdapter.hpp>
#include <opengv/relative_pose/methods.hpp>
#include <opengv/sac/Ransac.hpp>
#include <opengv/sac_problems/relative_pose/CentralRelativePoseSacProblem.hpp>

namespace swiftlet::test {
namespace {

opengv::bearingVectors_t vectors(const std::vector<Bearing>& values) {
  opengv::bearingVectors_t result;
  for (const Bearing& v : values) result.emplace_back(v[0], v[1], v[2]);
  return result;
}

template <typename Problem>
OpengvResult run(const std::shared_ptr<Problem>& problem, double threshold, double confidence,
                 int max_iterations) {
  opengv::sac::Ransac<Problem> ransac;
  ransac.sac_model_ = problem;
  ransac.threshold_ = threshold;
  ransac.probability_ = confidence;
  ransac.max_iterations_ = max_iterations;
  ransac.computeModel(0);
  OpengvResult result;
  for (int r = 0; r < 3; ++r) {
    for (int c = 0; c < 4; ++c)
      result.motion[static_cast<std::size_t>(4 * r + c)] = ransac.model_coefficients_(r, c);
  }
  result.inliers = ransac.inliers_;
  return result;
}

}  // namespace

// OpenGV's motions take frame 2 to frame 1: the current frame is given first.
OpengvResult opengvFivePointRansac(const std::vector<Bearing>& prev, const std::vector<Bearing>& cur,
                                   double threshold, double confidence, int max_iterations) {
  using Problem = opengv::sac_problems::relative_pose::CentralRelativePoseSacProblem;
  const opengv::bearingVectors_t first = vectors(cur);
  const opengv::bearingVectors_t second = vectors(prev);
  opengv::relative_pose::CentralRelativeAdapter adapter(first, second);
  return run(std::make_shared<Problem>(adapter, Problem::NISTER, false), threshold, confidence,
             max_iterations);
}

double opengvFivePointMicroseconds(const std::vector<Bearing>& prev, const std::vector<Bearing>& cur,
                                   int repeats) {
  const opengv::bearingVectors_t first = vectors(cur);
  const opengv::bearingVectors_t second = vectors(prev);
  opengv::relative_pose::CentralRelativeAdapter adapter(first, second);
  std::size_t solutions = 0;
  const std::clock_t begin = std::clock();
  for (int i = 0; i < repeats; ++i) solutions += opengv::relative_pose::fivept_nister(adapter).size();
  const double spent = 1e6 * static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  return solutions > 0 ? spent / repeats : -1.0;
}

}  // namespace swiftlet::test
