"""Programs of controls that somebody broke on purpose, by seed: the same seed breaks the same way."""

import random
import re

_NUMBER = re.compile(r"[+-]?\d+\.?\d*")
NUMBERS = ("0", "-1", "1e9", "99999999999", "0.0000001", "-0", "1.5.5", "+", "nan", "360", "1000000", "2147483648",
           "R1", "Q1")
SIGNS = "()[]\"=;:,+-*/<>~%$ \t\n\x00äXYZGQRNM0159"


def mutated(seed, texts):
    """A broken program made of one of the texts, sometimes of two."""
    rng = random.Random(seed)
    lines = rng.choice(texts).split("\n")
    for _ in range(rng.randint(1, 4)):
        lines = rng.choice(WAYS)(rng, lines, texts)
    return "\n".join(lines)


def _drop(rng, lines, _):
    k = rng.randrange(len(lines))
    return lines[:k] + lines[k + rng.randint(1, 3):] or [""]


def _twice(rng, lines, _):
    k = rng.randrange(len(lines))
    return lines[:k] + lines[k:k + 2] * rng.randint(2, 3) + lines[k:]


def _swap(rng, lines, _):
    out = list(lines)
    i, j = rng.randrange(len(out)), rng.randrange(len(out))
    out[i], out[j] = out[j], out[i]
    return out


def _number(rng, lines, _):
    k = rng.randrange(len(lines))
    found = list(_NUMBER.finditer(lines[k]))
    if not found:
        return lines
    m = rng.choice(found)
    return [*lines[:k], lines[k][:m.start()] + rng.choice(NUMBERS) + lines[k][m.end():], *lines[k + 1:]]


def _sign(rng, lines, _):
    k = rng.randrange(len(lines))
    at = rng.randint(0, len(lines[k]))
    gone = rng.randint(0, 2)
    return [*lines[:k], lines[k][:at] + rng.choice(SIGNS) * rng.choice((0, 1, 1, 60)) + lines[k][at + gone:],
            *lines[k + 1:]]


def _word(rng, lines, _):
    """Words of a line in another order, or one of them gone."""
    k = rng.randrange(len(lines))
    words = lines[k].split(" ")
    rng.shuffle(words)
    return [*lines[:k], " ".join(words[rng.randint(0, 1):]), *lines[k + 1:]]


def _graft(rng, lines, texts):
    """A line of another program."""
    k = rng.randrange(len(lines) + 1)
    return [*lines[:k], rng.choice(rng.choice(texts).split("\n")), *lines[k:]]


def _cut(rng, lines, _):
    text = "\n".join(lines)
    return text[:rng.randrange(len(text) + 1)].split("\n")


WAYS = (_drop, _twice, _swap, _number, _number, _sign, _sign, _word, _graft, _graft, _cut)
