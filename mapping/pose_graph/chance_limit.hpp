#pragma once
// How small a chance must be to believe a loop that nothing else vouches for, when many are tested.
//
// Of n random loops, each tested for agreeing as well as chance would with probability q, n q agree: the
// limit for one is what may agree in all over the number tested (Bonferroni). Loops that could not reach the
// limit if they agreed perfectly (the test is too vague there) do not count: no random one among them is
// believed either. With p_k the least chance that loop k can reach, the limit is max_false / K with the
// smallest K that is at least the number of p_k <= max_false / K (Tarone). Loops already believed need not be
// given (Holm: the limit rises as loops are taken).
//
// Holds whatever joins the tests. Sources: Tarone, "A modified Bonferroni method for discrete data",
// Biometrics 1990; Holm, "A simple sequentially rejective multiple test procedure", Scand. J. Stat. 1979.

#include <cstddef>
#include <span>

namespace swiftlet {

/// Logarithm of the limit. `least_log_chances`: logarithm of p_k for each loop tested, sorted here.
/// `max_false`, above 0: random loops believed, as a mean. Without loops that of `max_false`. n log n; no
/// allocation.
double logChanceLimit(double max_false, std::span<double> least_log_chances);

/// Logarithm of the chance at which loops are believed that agree with a solution, or that of 0 when none is.
/// Where hundreds agree at some chance that random ones would seldom reach, nearly all of them are true; the
/// same chance says little of one that stands alone. A loop of chance p is believed, and all of less, when of
/// random loops at most `max_false` times as many would reach p as there are loops between p / 10 and p. So a
/// random one is believed in `max_false` of all graphs that have no true ones left, and is that share of
/// those believed elsewhere (Benjamini and Hochberg, who count all below p; here what is proven beyond doubt
/// does not make up for what is not). `tested`: all loops tested, `log_chances`: those that agree, sorted
/// here.
double logDiscoveryLimit(double max_false, std::size_t tested, std::span<double> log_chances);

}  // namespace swiftlet
