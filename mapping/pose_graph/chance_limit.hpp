#pragma once
// Significance limits for accepting loops by the chance that a random loop would agree as well, when many
// loops are tested.
//
// Of n random loops, n q on average agree at a chance of q or less. Bonferroni's limit for one loop is
// therefore max_false / n, with max_false the number of random loops that may be accepted in total. Loops
// whose test is too vague to reach the limit even with perfect agreement do not count, because none of them
// can be accepted by chance. With p_k the least chance that loop k can reach, the limit is max_false / K with
// the smallest K that is at least the number of p_k <= max_false / K (Tarone). Loops accepted before need not
// be given (Holm: the limit rises as loops are accepted).
//
// Dependent tests are allowed. Sources: Tarone, "A modified Bonferroni method for discrete data", Biometrics
// 1990; Holm, "A simple sequentially rejective multiple test procedure", Scand. J. Stat. 1979.

#include <cstddef>
#include <span>

namespace swiftlet {

/// Logarithm of the limit. `least_log_chances`: logarithm of p_k for each loop tested; this function sorts
/// them. `max_false`, above 0: mean number of random loops accepted. Without loops the limit is `max_false`.
/// Cost n log n; no allocation.
double logChanceLimit(double max_false, std::span<double> least_log_chances);

/// Logarithm of the largest chance at which loops that agree with a solution are accepted; minus infinity if
/// none is. A loop of chance p, and all of smaller chance, are accepted if the expected number of random
/// loops that reach p is at most `max_false` times the number of loops between p / 10 and p. The reason: if
/// hundreds agree at a chance that random loops would seldom reach, nearly all of them are true; a lone loop
/// of the same chance may well be false. Random loops are thus accepted in a share `max_false` of the graphs
/// without true loops, and make up that share of the accepted loops elsewhere. Benjamini and Hochberg count
/// all loops below p; here only those of similar chance count, so that loops beyond doubt do not admit
/// doubtful ones. `tested`: number of loops tested. `log_chances`: those that agree; this function sorts
/// them.
double logDiscoveryLimit(double max_false, std::size_t tested, std::span<double> log_chances);

}  // namespace swiftlet
