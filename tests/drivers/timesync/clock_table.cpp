// Prints the errors of the clock maps on simulated links and what the trigger makes of random patterns: the
// tables of docs/experiments/timesync.md. usage: clock_table [SEEDS]
#include <cstdio>
#include <cstdlib>
#include <string>

#include "tests/drivers/timesync/clock_errors.hpp"
#include "tests/drivers/timesync/simulated_trigger.hpp"

namespace swiftlet::test {
namespace {

void row(const std::string& name, const LinkSettings& link, int seeds) {
  ClockErrors errors;
  double locked = 0;
  std::uint64_t resets = 0;
  for (int seed = 1; seed <= seeds; ++seed) {
    runClockMap(link, static_cast<std::uint64_t>(seed), errors);
    locked += errors.locked_share;
    resets += errors.status.resets;
  }
  std::printf("%-44s %8.4f %8.4f %8.4f %8.3f %7.2f %6llu %8zu %zu\n", name.c_str(),
              quantile(errors.settled, 0.5), quantile(errors.settled, 0.99), quantile(errors.settled, 1),
              quantile(errors.early, 0.99), 100 * locked / seeds, static_cast<unsigned long long>(resets),
              errors.refused, errors.not_rising);
}

void oneWay(int seeds) {
  std::printf("one way; |error| beyond the constant delay [ms], %d seeds\n", seeds);
  std::printf("%-44s %8s %8s %8s %8s %7s %6s %8s %s\n", "link", "p50", "p99", "max", "early99", "lock%",
              "resets", "refused", "not rising");
  for (const double skew : {100.0, -100.0}) {
    for (const Jitter jitter : {Jitter::kUniform, Jitter::kExponential}) {
      for (const bool in_order : {true, false}) {
        LinkSettings link;
        link.skew_ppm = skew;
        link.jitter = jitter;
        link.in_order = in_order;
        const std::string name = std::string(jitter == Jitter::kUniform ? "uniform" : "exponential") +
                                 (skew > 0 ? " +100 ppm" : " -100 ppm") + (in_order ? " in order" : "");
        row(name, link, seeds);
        link.seconds = 200;
        link.step_every = 37;
        row(name + " steps", link, seeds);
        link.largest_step = 0.02;
        row(name + " small steps", link, seeds);
        link.largest_step = 0;
        row(name + " back to 0", link, seeds);
      }
    }
  }
  LinkSettings link;
  link.jitter = Jitter::kExponential;
  link.seconds = 600;
  link.wander_ppm = 1;
  row("exponential, wander 1 ppm in 4 min", link, seeds);
  link.wander_period = 60;
  row("exponential, wander 1 ppm in 1 min", link, seeds);
  link.wander_ppm = 0;
  link.warm_ppm_per_s = 0.2;
  row("exponential, warms by 0.2 ppm/s", link, seeds);
  link.warm_ppm_per_s = 0;
  link.outage_at = 60;
  link.outage_for = 120;
  row("exponential, outage of 2 min", link, seeds);
  link.wander_ppm = 1;
  row("exponential, wander, outage of 2 min", link, seeds);
  link = LinkSettings();
  link.seconds = 4 * 3600;
  link.wander_ppm = 1;
  link.jitter = Jitter::kExponential;
  row("exponential, 4 hours, wander", link, 2);
  for (const double skew : {5000.0, -20'000.0}) {
    LinkSettings oscillator;
    oscillator.jitter = Jitter::kExponential;
    oscillator.skew_ppm = skew;
    row("exponential, " + std::to_string(static_cast<int>(skew)) + " ppm", oscillator, seeds);
    oscillator.seconds = 200;
    oscillator.step_every = 37;
    row("exponential, " + std::to_string(static_cast<int>(skew)) + " ppm, steps", oscillator, seeds);
  }
  link.seconds = 200;
  link.wander_ppm = 0;
  link.rate = 20;
  row("exponential, 20 Hz", link, seeds);
  link.rate = 1000;
  link.in_order = false;
  row("exponential, 1000 Hz", link, seeds);
  link.rate = 200;
  link.jitter = Jitter::kNone;
  row("no jitter", link, seeds);
  link.step_every = 37;
  row("no jitter, steps", link, seeds);
  link.step_every = 0;
  link.jitter = Jitter::kExponential;
  link.in_order = true;
  link.seconds = 120;
  link.slew_at = 40;
  link.slew_for = 30;
  for (const double slew : {500.0, 20'000.0}) {
    link.slew_ppm = slew;
    row("exponential, slewed by " + std::to_string(static_cast<int>(slew)) + " ppm for 30 s", link, seeds);
  }
}

void twoWay(int seeds) {
  std::printf(
      "\ntwo way; |error| beyond half the asymmetry [ms], %d seeds; last: the filter of round trips\n",
      seeds);
  std::printf("%-44s %8s %8s %8s %7s %6s %6s %8s\n", "link", "p50", "p99", "max", "lock%", "resets", "beyond",
              "filter99");
  for (const double rate : {200.0, 10.0}) {
    for (const Jitter jitter : {Jitter::kUniform, Jitter::kExponential}) {
      for (const double step_every : {0.0, 37.0}) {
        LinkSettings link;
        link.rate = rate;
        link.jitter = jitter;
        link.step_every = step_every;
        link.seconds = step_every > 0 ? 200 : 60;
        constexpr double kForth = 1;
        ClockErrors errors;
        std::vector<double> filter;
        double locked = 0;
        std::uint64_t resets = 0;
        for (int seed = 1; seed <= seeds; ++seed) {
          runTwoWay(link, kForth, static_cast<std::uint64_t>(seed), errors);
          locked += errors.locked_share;
          resets += errors.status.resets;
          if (rate > 100) continue;
          const auto some = runRoundTripFilter(link, kForth, static_cast<std::uint64_t>(seed));
          filter.insert(filter.end(), some.begin(), some.end());
        }
        const std::string name = std::to_string(static_cast<int>(rate)) + " Hz " +
                                 (jitter == Jitter::kUniform ? "uniform" : "exponential") +
                                 (step_every > 0 ? ", steps" : "");
        std::printf("%-44s %8.4f %8.4f %8.4f %7.2f %6llu %6zu %8.3f\n", name.c_str(),
                    quantile(errors.settled, 0.5), quantile(errors.settled, 0.99),
                    quantile(errors.settled, 1), 100 * locked / seeds,
                    static_cast<unsigned long long>(resets), errors.beyond_bound, quantile(filter, 0.99));
      }
    }
  }
}

void triggerRow(const char* name, void (*change)(TriggerPattern&)) {
  constexpr std::uint64_t kPatterns = 10'000;
  TriggerResult all;
  for (std::uint64_t seed = 0; seed < kPatterns; ++seed) {
    Random random(seed, 9);
    TriggerPattern p = randomPattern(random);
    change(p);
    const double mean = p.lag + (p.one_sided ? p.stamp_jitter / 2 : 0);
    const TriggerResult one = runTrigger(p, mean + random.uniform(-0.1, 0.1), seed);
    all.frames += one.frames;
    all.matched += one.matched;
    all.slips += one.slips;
    all.worst = std::max(all.worst, one.worst);
  }
  std::printf("%-44s %9zu %7.2f %6zu %8.3f\n", name, all.frames,
              100.0 * static_cast<double>(all.matched) / static_cast<double>(all.frames), all.slips,
              all.worst);
}

void trigger() {
  std::printf("\ntrigger; 10 000 random patterns of 400 pulses each\n%-44s %9s %7s %6s %8s\n", "pattern",
              "frames", "edge%", "slips", "worst [periods]");
  const auto drops_only = [](TriggerPattern& p) {
    p.glitch = p.burst = p.restart = p.late = p.silent = p.pause = 0;
  };
  triggerRow("dropped edges and frames", drops_only);
  triggerRow("and glitches, bursts, restarts, late frames",
             [](TriggerPattern& p) { p.silent = p.pause = 0; });
  triggerRow("and lost uncounted, and a trigger that pauses", [](TriggerPattern&) {});
}

}  // namespace
}  // namespace swiftlet::test

int main(int argc, char** argv) {
  const int seeds = argc > 1 ? std::atoi(argv[1]) : 50;
  swiftlet::test::oneWay(seeds);
  swiftlet::test::twoWay(seeds);
  swiftlet::test::trigger();
  return 0;
}
