#pragma once
// Where a thread asks what its stage may spend on the next frame, and says what it took.

#include "estimator/messages/effort.hpp"

namespace swiftlet {

/// How late a frame is as its step begins.
struct StepLoad {
  double age = 0;   ///< s since it arrived
  int waiting = 0;  ///< frames behind it
};

class EffortSource {
 public:
  EffortSource() = default;
  EffortSource(const EffortSource&) = delete;
  EffortSource& operator=(const EffortSource&) = delete;
  virtual ~EffortSource() = default;

  virtual Effort give(const StepLoad& load) = 0;
  /// Wall time of the step that followed.
  virtual void took(double seconds) = 0;
  /// Steps below full effort.
  [[nodiscard]] virtual int level() const = 0;
};

/// The same for every frame: lockstep, where time is no matter.
class ConstantEffort : public EffortSource {
 public:
  explicit ConstantEffort(const Effort& effort) : effort_(effort) {}
  Effort give(const StepLoad& /*load*/) override { return effort_; }
  void took(double /*seconds*/) override {}
  [[nodiscard]] int level() const override { return 0; }

 private:
  Effort effort_;
};

}  // namespace swiftlet
