#include "firmware_host/supervisor/verdict.hpp"

#include <nlohmann/json.hpp>
#include <type_traits>

namespace swiftlet {
namespace {

int severity(Health health) {
  switch (health) {
    case Health::kGood:
      return 0;
    case Health::kDegraded:
      return 1;
    case Health::kInitializing:
      return 2;
    case Health::kFailed:
      return 3;
  }
  return 3;
}

}  // namespace

static_assert(std::is_trivially_copyable_v<Verdict>);

Health worse(Health a, Health b) { return severity(a) >= severity(b) ? a : b; }

const char* conditionName(Condition condition) {
  switch (condition) {
    case Condition::kOk:
      return "ok";
    case Condition::kLate:
      return "late";
    case Condition::kLost:
      return "lost";
    case Condition::kUnsteady:
      return "unsteady";
  }
  return "unknown";
}

bool Trouble::sameAs(const Trouble& other) const {
  return row == other.row && condition == other.condition && cause == other.cause;
}

const Trouble* Verdict::worst() const {
  const Trouble* worst = nullptr;
  for (const Trouble& trouble : troubles) {
    const bool more = worst == nullptr || severity(trouble.effect) > severity(worst->effect) ||
                      (trouble.effect == worst->effect && trouble.condition == Condition::kLost &&
                       worst->condition != Condition::kLost);
    if (more) worst = &trouble;
  }
  return worst;
}

nlohmann::ordered_json toJson(const Verdict& verdict) {
  nlohmann::ordered_json troubles = nlohmann::ordered_json::array();
  for (const Trouble& trouble : verdict.troubles) {
    troubles.push_back({{"member", trouble.name()},
                        {"condition", conditionName(trouble.condition)},
                        {"since_ns", trouble.since.ns},
                        {"text", trouble.text.data()}});
  }
  return {{"run_failed", verdict.run_failed}, {"arming", toJson(verdict.arming)}, {"troubles", troubles}};
}

}  // namespace swiftlet
