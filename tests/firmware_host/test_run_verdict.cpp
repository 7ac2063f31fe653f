// What is said of a whole run.

#include "firmware_host/interfaces/run_verdict.hpp"

#include <catch2/catch.hpp>
#include <memory>

using namespace swiftlet;

TEST_CASE("run verdict: shares of time, doubts, sigmas and the estimated calibration", "[verdict]") {
  RunVerdict verdict;
  CHECK(verdict.shareGood() == 1);  // nothing flown, nothing to blame
  auto output = std::make_unique<OdometryOutput>();
  const auto frames = [&](int from, int to, Health health, Doubt doubt, bool has_state = true) {
    for (int k = from; k < to; ++k) {
      output->has_state = has_state;
      output->state.health = health;
      output->doubt = doubt;
      output->state.v_world_body = {health == Health::kDegraded ? 3.0 : 1.0, 0, 0};
      output->statistics.noise.pixel_sigma = health == Health::kDegraded ? 2.5 : 0.5;  // 1.17 on the mean
      output->state.covariance = (health == Health::kGood ? 1e-4 : 1.0) * Matrix15d::Identity();
      verdict.add(Stamp{k * 50'000'000LL}, *output);
    }
  };
  frames(0, 21, Health::kGood, Doubt::kNone, false);  // no state yet, whatever the fields say: 1 s
  frames(21, 141, Health::kGood, Doubt::kNone);       // 6 s
  output->state.epoch = 2;
  output->calibration.shift_sigma = 1e-4;
  output->calibration.camera_to_imu_shift = Duration::fromMilliseconds(3);
  frames(141, 201, Health::kDegraded, Doubt::kTracksDisagree);  // 3 s
  CHECK(verdict.shareGood() == Approx(0.6));
  const auto json = verdict.json();
  CHECK(json["seconds"].get<double>() == Approx(10));
  CHECK(json["health_s"]["initializing"].get<double>() == Approx(1));
  CHECK(json["health_s"]["degraded"].get<double>() == Approx(3));
  CHECK(json["doubts_s"]["tracks_disagree"].get<double>() == Approx(3));
  CHECK(json["resets"] == 2);
  CHECK(json["top_speed_m_s"].get<double>() == Approx(3));
  CHECK(json["largest_velocity_sigma_good_m_s"].get<double>() == Approx(0.01));
  CHECK(json["estimated_calibration"]["t_imu_minus_t_image_s"].get<double>() == Approx(3e-3));
  CHECK_FALSE(json["estimated_calibration"].contains("cam0"));
  const auto words = json["in_words"].get<std::vector<std::string>>();
  CHECK(json["mean_pixel_sigma_px"].get<double>() == Approx((6 * 0.5 + 3 * 2.5) / 9));
  REQUIRE(words.size() == 4);
  CHECK(words[1].find("track residuals average 1.2 px, smoother.pixel_sigma is 0.50") != std::string::npos);
  CHECK(words[0].find("good 60.0 %") != std::string::npos);
  CHECK(words[2].find("3.0 s tracks_disagree: ") != std::string::npos);
}

TEST_CASE("run verdict: what is found of sensors and tracks", "[verdict]") {
  RunVerdict verdict;
  auto output = std::make_unique<OdometryOutput>();
  output->has_state = true;
  output->state.health = Health::kGood;
  output->statistics.pose_variance_factor = 1.6;
  output->statistics.noise.imu.gyro = 3.1;
  output->calibration.gyro.matrix(0, 1) = 0.01;
  output->calibration.shift_sigma = 1e-4;
  output->calibration.readout = Duration::fromMilliseconds(20);
  output->calibration.readout_sigma = 5e-5;
  for (int k = 0; k < 41; ++k) verdict.add(Stamp{k * 50'000'000LL}, *output);
  const auto json = verdict.json();
  CHECK(json["mean_pose_variance_factor"].get<double>() == Approx(1.6));
  CHECK(json["mean_gyro_factor"].get<double>() == Approx(3.1));
  CHECK(json["mean_accel_factor"].get<double>() == Approx(1));
  CHECK(json["gyro_matrix"][0][1].get<double>() == Approx(0.01));
  CHECK(json["estimated_calibration"]["readout_s"].get<double>() == Approx(0.02));
  CHECK(json["estimated_calibration"]["readout_sigma_s"].get<double>() == Approx(5e-5));
  const auto words = json["in_words"].get<std::vector<std::string>>();
  REQUIRE(words.size() == 2);
  CHECK(words[1].find("errors of the gyro are 3.1 times") != std::string::npos);
}
