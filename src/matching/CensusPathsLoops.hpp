#pragma once

// The loops behind CensusPathsFunctions, for vectors of any type as ByteVector16 is one. Included once by a
// file for each type.

#include <cstddef>
#include <cstdint>

#include "CensusPaths.hpp"

namespace disparity_refinement {
namespace {

/// FIXED: the number of vectors of a pixel; 0: known only at run time.
template <class Vector, int FIXED>
class CensusPathsLoops {
 public:
  static void findCosts(const CensusPathsInput& input, int y, int x_begin, int x_end, std::uint8_t* costs) {
    Costs row(input, y, x_begin);
    for (int x = x_begin; x < x_end; ++x) {
      Values c;
      row.next(c);
      c.store(costs + x * bytesOf(input), vectorsOf(input));
    }
  }

  static void step(const CensusPathsInput& input, int y, int x_begin, int x_end, const CensusCostRows& rows,
                   std::uint8_t* state) {
    if (input.aggregate_rows) {
      step<true>(input, y, x_begin, x_end, rows, state);
    } else {
      step<false>(input, y, x_begin, x_end, rows, state);
    }
  }

  static void stepAndKeep(const CensusPathsInput& input, int y, const CensusCostRows& rows,
                          std::uint8_t* state, std::uint8_t* costs, std::uint8_t* values) {
    if (input.aggregate_rows) {
      stepAndKeep<true>(input, y, rows, state, costs, values);
    } else {
      stepAndKeep<false>(input, y, rows, state, costs, values);
    }
  }

  static void addPaths(const CensusPathsInput& input, const std::uint8_t* costs, std::uint8_t* state,
                       std::uint8_t* sums, const std::uint8_t* costs_before, std::uint8_t* sums_before) {
    if (costs != nullptr && costs_before != nullptr) {
      addPaths<true, true>(input, costs, state, sums, costs_before, sums_before);
    } else if (costs != nullptr) {
      addPaths<true, false>(input, costs, state, sums, costs_before, sums_before);
    } else {
      addPaths<false, true>(input, costs, state, sums, costs_before, sums_before);
    }
  }

  static void findWinners(const CensusPathsInput& input, const std::uint8_t* sums,
                          const CensusWinners& winners) {
    if (input.ambiguous != nullptr) {
      findWinners<true>(input, sums, winners);
    } else {
      findWinners<false>(input, sums, winners);
    }
  }

 private:
  static constexpr int N = Vector::LANES;
  static constexpr int CAPACITY = FIXED > 0 ? FIXED : MAX_DISPARITIES / N;
  // One byte holds a disparity.
  static constexpr bool IS_SMALL = FIXED > 0 && FIXED* N <= 256;

  static int vectorsOf(const CensusPathsInput& input) { return FIXED > 0 ? FIXED : input.vectors; }
  static std::ptrdiff_t bytesOf(const CensusPathsInput& input) { return vectorsOf(input) * N; }

  struct Values {
    Vector of[CAPACITY];

    void load(const std::uint8_t* bytes, int vectors) {
      of[0] = Vector::load(bytes);
      for (int r = 1; r < vectors; ++r) of[r] = Vector::load(bytes + r * N);
    }
    void store(std::uint8_t* bytes, int vectors) const {
      for (int r = 0; r < vectors; ++r) of[r].store(bytes + r * N);
    }
    void fill(std::uint8_t value, int vectors) {
      for (int r = 0; r < vectors; ++r) of[r] = Vector::all(value);
    }
  };

  template <bool OF_ROWS>
  static void step(const CensusPathsInput& input, int y, int x_begin, int x_end, const CensusCostRows& rows,
                   std::uint8_t* state) {
    Costs costs(input, OF_ROWS ? rows.after : y, x_begin);
    const Step next(input);
    const int vectors = vectorsOf(input);
    for (int x = x_begin; x < x_end; ++x) {
      const std::ptrdiff_t offset = x * bytesOf(input);
      Values c, path;
      costs.next(c);
      if (OF_ROWS) averageRows(rows, offset, vectors, c);
      path.load(state + offset, vectors);
      next.advance(path, c, [](int, Vector) {});
      path.store(state + offset, vectors);
    }
  }

  template <bool OF_ROWS>
  static void stepAndKeep(const CensusPathsInput& input, int y, const CensusCostRows& rows,
                          std::uint8_t* state, std::uint8_t* kept_costs, std::uint8_t* kept_values) {
    Costs costs(input, OF_ROWS ? rows.after : y, 0);
    const Step next(input);
    const int vectors = vectorsOf(input);
    for (int x = 0; x < input.width; ++x) {
      const std::ptrdiff_t offset = x * bytesOf(input);
      Values c, path;
      costs.next(c);
      if (OF_ROWS) averageRows(rows, offset, vectors, c);
      c.store(kept_costs + offset, vectors);
      path.load(state + offset, vectors);
      next.advance(path, c, [&](int r, Vector value) { value.store(kept_values + offset + r * N); });
      path.store(state + offset, vectors);
    }
  }

  // `c`: the costs of a pixel of the row after, and then the averages of the row here.
  static void averageRows(const CensusCostRows& rows, std::ptrdiff_t offset, int vectors, Values& c) {
    for (int r = 0; r < vectors; ++r) {
      const Vector here = Vector::load(rows.here + offset + r * N);
      const Vector before = Vector::load(rows.beside + offset + r * N);
      c.of[r].store(rows.beside + offset + r * N);
      c.of[r] = average(average(before, c.of[r]), here);
    }
  }

  // The costs of all disparities of the pixels of row y, from x on, one pixel after the other.
  class Costs {
   public:
    Costs(const CensusPathsInput& input, int y, int x)
        : vectors_(vectorsOf(input)),
          last_(input.width - 1),
          first_inside_(input.min_disparity + input.disparities - 1),
          end_inside_(input.width + input.min_disparity),
          has_beyond_(input.disparities < bytesOf(input)),
          phase_step_(input.phase_step),
          inside_(input.inside),
          beyond_(input.beyond),
          x_(x) {
      for (int k = 0; k < 3; ++k) {
        left_[k] = input.left[k] + y * input.left_step;
        right_[k] = input.right[k] + y * input.right_step;
      }
      compare(x, here_);
      compare(x > 0 ? x - 1 : x, before_);
    }

    void next(Values& c) {
      Values after;
      compare(x_ < last_ ? x_ + 1 : x_, after);
      for (int r = 0; r < vectors_; ++r) {
        c.of[r] = average(average(before_.of[r], after.of[r]), here_.of[r]);
        before_.of[r] = here_.of[r];
        here_.of[r] = after.of[r];
      }
      if (has_beyond_) {
        for (int r = 0; r < vectors_; ++r) c.of[r] = either(c.of[r], Vector::load(beyond_ + r * N));
      }
      ++x_;
    }

   private:
    // The costs of a single pixel.
    void compare(int x, Values& c) const {
      const unsigned position = static_cast<unsigned>(last_ - x);
      const unsigned vectors = static_cast<unsigned>(vectors_);
      const std::ptrdiff_t first = (position % vectors) * phase_step_ + position / vectors;
      const Vector l0 = Vector::all(left_[0][x]), l1 = Vector::all(left_[1][x]),
                   l2 = Vector::all(left_[2][x]);
      const std::uint8_t *r0 = right_[0] + first, *r1 = right_[1] + first, *r2 = right_[2] + first;
      for (int r = 0; r < vectors_; ++r) {
        const std::ptrdiff_t phase = r * phase_step_;
        c.of[r] = add(differingBits(l0, l1, Vector::load(r0 + phase), Vector::load(r1 + phase)),
                      difference(l2, Vector::load(r2 + phase)));
      }
      if (x < first_inside_ || x >= end_inside_) {
        for (int r = 0; r < vectors_; ++r) {
          c.of[r] = choose(Vector::load(inside_ + first + r * phase_step_), c.of[r],
                           Vector::all(OUTSIDE_CENSUS_COST));
        }
      }
    }

    const int vectors_, last_, first_inside_, end_inside_;
    const bool has_beyond_;
    const std::ptrdiff_t phase_step_;
    const std::uint8_t *left_[3], *right_[3], *inside_, *beyond_;
    int x_;
    Values before_, here_;  // Those of the pixels x_ - 1 and x_.
  };

  // One step of a path.
  class Step {
   public:
    explicit Step(const CensusPathsInput& input)
        : vectors_(vectorsOf(input)), p1_(Vector::all(input.p1)), p2_(Vector::all(input.p2)) {}

    // `path`: the values of the pixel before less their least one, then those of this pixel. `keep` is given
    // the values themselves.
    template <class Keep>
    void advance(Values& path, const Values& c, const Keep& keep) const {
      const int last = vectors_ - 1;
      const Vector below_first = fromLaneBelow(path.of[last]), above_last = fromLaneAbove(path.of[0]);
      Vector before = below_first, lowest = Vector::all(255);
      for (int r = 0; r < vectors_; ++r) {
        const Vector here = path.of[r];
        const Vector after = r < last ? path.of[r + 1] : above_last;
        const Vector from = least(add(least(before, after), p1_), least(here, p2_));
        const Vector value = add(from, c.of[r]);
        keep(r, value);
        lowest = least(lowest, value);
        path.of[r] = value;
        before = here;
      }
      lowest = leastOfLanes(lowest);
      for (int r = 0; r < vectors_; ++r) path.of[r] = subtract(path.of[r], lowest);
    }

   private:
    const int vectors_;
    const Vector p1_, p2_;
  };

  // The two rows in one loop: the steps of one path wait for each other, those of different paths do not.
  template <bool DOWN, bool BACK>
  static void addPaths(const CensusPathsInput& input, const std::uint8_t* costs, std::uint8_t* state,
                       std::uint8_t* sums, const std::uint8_t* costs_before, std::uint8_t* sums_before) {
    const Step next(input);
    const int vectors = vectorsOf(input);
    Values from_left, from_right;
    from_left.fill(0, vectors);
    from_right.fill(0, vectors);
    const std::ptrdiff_t bytes = bytesOf(input);
    for (int x = 0; x < input.width; ++x) {
      if (DOWN) {
        const std::ptrdiff_t offset = x * bytes;
        std::uint8_t* sum = sums + offset;
        Values c, from_above, values;
        c.load(costs + offset, vectors);
        from_above.load(state + offset, vectors);
        next.advance(from_above, c,
                     [&](int r, Vector value) { values.of[r] = add(value, Vector::load(sum + r * N)); });
        from_above.store(state + offset, vectors);
        next.advance(from_left, c, [&](int r, Vector value) { add(value, values.of[r]).store(sum + r * N); });
      }
      if (BACK) {
        const std::ptrdiff_t offset = (input.width - 1 - x) * bytes;
        std::uint8_t* sum = sums_before + offset;
        Values c;
        c.load(costs_before + offset, vectors);
        next.advance(from_right, c,
                     [&](int r, Vector value) { add(value, Vector::load(sum + r * N)).store(sum + r * N); });
      }
    }
  }

  // The least sum of every lane, and which vector has it first.
  static int firstLeast(const Values& sums, int vectors, Vector& lowest) {
    Vector least_of_lane = sums.of[0], which = Vector::all(0);
    for (int r = 1; r < vectors; ++r) {
      const Vector smaller = least(least_of_lane, sums.of[r]);
      which = choose(equal(smaller, least_of_lane), which, Vector::all(static_cast<std::uint8_t>(r)));
      least_of_lane = smaller;
    }
    lowest = leastOfLanes(least_of_lane);
    // The disparities of a lane are smaller than those of the next one.
    const int lane = __builtin_ctz(bitsOf(equal(least_of_lane, lowest)));
    std::uint8_t vector_of_lane[N];
    which.store(vector_of_lane);
    return lane * vectors + vector_of_lane[lane];
  }

  template <bool CHECK_UNIQUENESS>
  static void findWinners(const CensusPathsInput& input, const std::uint8_t* sums,
                          const CensusWinners& winners) {
    const int vectors = vectorsOf(input), last = vectors - 1;
    const int last_disparity = input.disparities - 1;
    const std::ptrdiff_t bytes = bytesOf(input);
    // Of the right pixels that the disparities of this pixel lead to: the least sum so far, and its
    // disparity. They come by in the order of their disparities.
    Values right_least, right_low, right_high;
    right_least.fill(255, vectors);
    right_low.fill(0, vectors);
    right_high.fill(0, vectors);
    // Before the first disparity there is none, not even where the sum is 255.
    const Vector has_before = equal(fromLaneBelow(Vector::all(0)), Vector::all(0));
    std::uint8_t low[N], high[N] = {};
    const int last_lane = last_disparity / vectors, last_vector = last_disparity % vectors;

    for (int x = 0; x < input.width; ++x) {
      const std::uint8_t* pixel = sums + x * bytes;
      Values s;
      s.load(pixel, vectors);
      Vector lowest;
      const int d = firstLeast(s, vectors, lowest);
      const int sum = pixel[input.place[d]];
      winners.disparity[x] = static_cast<std::uint16_t>(d);
      const int before = d > 0 ? pixel[input.place[d - 1]] : 255;
      const int after = d < last_disparity ? pixel[input.place[d + 1]] : 255;
      winners.subpixel[x] =
          d > 0 && d < last_disparity ? subpixel(before - sum, after - sum) : std::int8_t{0};
      if (CHECK_UNIQUENESS) {
        const int bound = input.ambiguous[sum];
        const Vector bounds = Vector::all(static_cast<std::uint8_t>(bound));
        // What fills the vectors is 255.
        int others = bound < 255 ? 0 : input.disparities - vectors * N;
        Vector count = Vector::all(0);
        for (int r = 0; r < vectors; ++r) {
          count = add(count, both(equal(least(s.of[r], bounds), s.of[r]), Vector::all(1)));
        }
        others += sumOfLanes(count);
        others -= (sum <= bound) + (d > 0 && before <= bound) + (d < last_disparity && after <= bound);
        winners.is_ambiguous[x] = others > 0;
      } else {
        winners.is_ambiguous[x] = 0;
      }

      // The same right pixel is one disparity further than at x - 1.
      const Vector first_least = fromLaneBelow(right_least.of[last]);
      const Vector first_low = both(fromLaneBelow(right_low.of[last]), has_before);
      const Vector first_high = IS_SMALL ? first_low : both(fromLaneBelow(right_high.of[last]), has_before);
      for (int r = last; r >= 0; --r) {
        const Vector old_least = r > 0 ? right_least.of[r - 1] : first_least;
        const Vector new_least = least(old_least, s.of[r]);
        const Vector is_old = equal(new_least, old_least);
        right_least.of[r] = new_least;
        right_low.of[r] =
            choose(is_old, r > 0 ? right_low.of[r - 1] : first_low, Vector::load(input.low_bytes + r * N));
        if (!IS_SMALL) {
          right_high.of[r] = choose(is_old, r > 0 ? right_high.of[r - 1] : first_high,
                                    Vector::load(input.high_bytes + r * N));
        }
      }
      right_low.of[last_vector].store(low);
      if (!IS_SMALL) right_high.of[last_vector].store(high);
      winners.right_disparity[x - last_disparity] =
          static_cast<std::uint16_t>(low[last_lane] + 256 * high[last_lane]);
    }
    // Those that have not met all disparities.
    std::uint8_t all_low[CAPACITY * N], all_high[IS_SMALL ? 1 : CAPACITY * N] = {};
    right_low.store(all_low, vectors);
    if (!IS_SMALL) right_high.store(all_high, vectors);
    for (int d = 0; d < last_disparity; ++d) {
      const int place = input.place[d];
      winners.right_disparity[input.width - 1 - d] =
          static_cast<std::uint16_t>(all_low[place] + (IS_SMALL ? 0 : 256 * all_high[place]));
    }
  }

  // The minimum of two lines of opposite slope through the sums at d - 1, d and d + 1; the arguments are how
  // much larger those at d - 1 and d + 1 are than the one at d.
  static std::int8_t subpixel(int before, int after) {
    const int larger = before > after ? before : after;
    if (larger == 0) return 0;
    // Rounded to the nearest step, upwards at the middle.
    constexpr int STEPS = 16;
    return static_cast<std::int8_t>((STEPS * (before - after) + larger * (STEPS + 1)) / (2 * larger) -
                                    STEPS / 2);
  }
};

/// Calls a function of the loops for the number of vectors of a pixel.
template <class Vector>
struct CensusPathsDispatch {
  template <class Call>
  static void with(int vectors, const Call& call) {
    constexpr int N = Vector::LANES;
    switch (vectors * N) {
      case 64:
        return call(CensusPathsLoops<Vector, 64 / N>());
      case 128:
        return call(CensusPathsLoops<Vector, 128 / N>());
      case 192:
        return call(CensusPathsLoops<Vector, 192 / N>());
      case 256:
        return call(CensusPathsLoops<Vector, 256 / N>());
      default:
        return call(CensusPathsLoops<Vector, 0>());
    }
  }

  static void findCosts(const CensusPathsInput& input, int y, int x_begin, int x_end, std::uint8_t* costs) {
    with(input.vectors, [&](auto loops) { loops.findCosts(input, y, x_begin, x_end, costs); });
  }
  static void step(const CensusPathsInput& input, int y, int x_begin, int x_end, const CensusCostRows& rows,
                   std::uint8_t* state) {
    with(input.vectors, [&](auto loops) { loops.step(input, y, x_begin, x_end, rows, state); });
  }
  static void stepAndKeep(const CensusPathsInput& input, int y, const CensusCostRows& rows,
                          std::uint8_t* state, std::uint8_t* costs, std::uint8_t* values) {
    with(input.vectors, [&](auto loops) { loops.stepAndKeep(input, y, rows, state, costs, values); });
  }
  static void addPaths(const CensusPathsInput& input, const std::uint8_t* costs, std::uint8_t* state,
                       std::uint8_t* sums, const std::uint8_t* costs_before, std::uint8_t* sums_before) {
    with(input.vectors,
         [&](auto loops) { loops.addPaths(input, costs, state, sums, costs_before, sums_before); });
  }
  static void findWinners(const CensusPathsInput& input, const std::uint8_t* sums,
                          const CensusWinners& winners) {
    with(input.vectors, [&](auto loops) { loops.findWinners(input, sums, winners); });
  }

  static constexpr CensusPathsFunctions FUNCTIONS = {Vector::LANES, findCosts, step,
                                                     stepAndKeep,   addPaths,  findWinners};
};

}  // namespace
}  // namespace disparity_refinement
