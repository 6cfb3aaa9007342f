// Values that follow from others and cost something: kept until what they follow from is another.

/** `make`, called again only when one of its arguments is not the same as last time. */
export function memo<A extends readonly unknown[], R>(make: (...from: A) => R): (...from: A) => R {
  let last: { from: A; value: R } | null = null;
  return (...from) => {
    const before = last;
    if (before?.from.length === from.length && from.every((value, index) => value === before.from[index])) {
      return before.value;
    }
    const value = make(...from);
    last = { from, value };
    return value;
  };
}
