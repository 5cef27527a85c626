# The page, built by Node; the image itself has none.
FROM node:22-slim AS page
WORKDIR /build/web
COPY web/package.json web/package-lock.json web/.npmrc ./
RUN npm ci
COPY openapi.yaml /build/
COPY web ./
RUN mkdir /build/service && npm run build

# One image for api, worker and scheduler. The numba kernels are compiled while it is built, so a container starts warm.
FROM python:3.11-slim

# The OpenCASCADE wheel links these libraries even where nothing is drawn.
RUN apt-get update \
    && apt-get install --yes --no-install-recommends libexpat1 libgl1 libx11-6 \
    && rm -rf /var/lib/apt/lists/*

ENV PYTHONUNBUFFERED=1 PIP_NO_CACHE_DIR=1 PIP_DISABLE_PIP_VERSION_CHECK=1
WORKDIR /app

COPY requirements-runtime.lock ./
RUN pip install --no-deps --requirement requirements-runtime.lock

COPY pyproject.toml README.md LICENSE ./
COPY geometry geometry
COPY zones zones
COPY toolpath toolpath
COPY output output
COPY verify verify
COPY schemas schemas
COPY service service
COPY --from=page /build/service/page service/page
COPY examples examples
RUN pip install --no-deps --editable .

RUN useradd --system --uid 10001 --home-dir /app zonemill \
    && mkdir /data /app/numba && chown zonemill /data /app/numba
USER zonemill

# Plans the sample part once: a build that cannot prove it fails. The compiled kernels stay in a folder of the user's
# own, for numba caches only where it may write.
ENV NUMBA_CACHE_DIR=/app/numba
RUN zonemill demo --out /tmp/demo && rm -rf /tmp/demo

VOLUME /data
EXPOSE 8000
CMD ["zonemill", "serve", "--host", "127.0.0.1", "--data", "/data"]
