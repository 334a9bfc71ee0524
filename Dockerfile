# docker build -t cubicfish .
# docker run --rm -u "$(id -u):$(id -g)" -v "$PWD:/work" cubicfish calibrate photos/ -t target.yaml
FROM python:3.13-slim AS build
WORKDIR /source
COPY pyproject.toml README.md LICENSE ./
COPY cubicfish cubicfish
COPY cubicfish_cli cubicfish_cli
RUN python -m venv /opt/cubicfish \
    && /opt/cubicfish/bin/pip install --no-cache-dir ".[report,video]"

FROM python:3.13-slim
COPY --from=build /opt/cubicfish /opt/cubicfish
# Any user may run it, also one that the image does not know: nothing is written outside /work but
# to the cache.
RUN useradd --create-home --uid 1000 cubicfish \
    && mkdir -m 1777 /cache /work
ENV PATH=/opt/cubicfish/bin:$PATH CUBICFISH_CACHE=/cache
USER 1000
WORKDIR /work
ENTRYPOINT ["cubicfish"]
CMD ["--help"]
