"""A camera's source in each language, compiled or loaded there, and what it answers.

``ask`` writes the cameras as one file each, and runs all of them in one process.
"""

from __future__ import annotations

import base64
import re
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from cubicfish import CameraFile, FloatArray
from cubicfish_cli.extensions.native.source import source_text


@dataclass(frozen=True, kw_only=True, eq=False)
class Questions:
    """What a camera is asked: directions and points (N, 3), and pixels (N, 2)."""

    rays: FloatArray
    points: FloatArray
    pixel: FloatArray


@dataclass(frozen=True, kw_only=True, eq=False)
class Answers:
    """Pixels of rays and of points (N, 2), rays of pixels (N, 3); slopes (N, 2, 3) where known."""

    of_rays: FloatArray
    of_points: FloatArray
    of_pixel: FloatArray
    slopes: FloatArray | None = None


_C = """
#include <stdio.h>
#include <stdlib.h>
{includes}
static double get(void) {{
  double one;
  if (fread(&one, sizeof one, 1, stdin) != 1) exit(1);
  return one;
}}
static void put(const double *of, int count) {{ fwrite(of, sizeof *of, (size_t)count, stdout); }}
#define ANSWER(name) \\
  for (k = 0; k < {count}; ++k) {{ \\
    double given[8], out[13], same[2]; \\
    int j, known; \\
    for (j = 0; j < 8; ++j) given[j] = get(); \\
    name##_project_ray(given, out); \\
    known = name##_project_jacobian(given + 3, out + 2, out + 4); \\
    if (name##_project(given + 3, same) != known) exit(2); \\
    if (known && (same[0] != out[2] || same[1] != out[3])) exit(3); \\
    name##_unproject(given + 6, out + 10); \\
    put(out, 13); \\
  }}
int main(void) {{
  int k;
  {answers}
  return 0;
}}
"""
_JS = """
import {{ readFileSync, writeSync }} from "node:fs";
const bytes = readFileSync(0), count = {count};
const given = new Float64Array(bytes.buffer, bytes.byteOffset, bytes.length / 8);
const none = [NaN, NaN, NaN], out = [];
let at = 0;
for (const file of {files}) {{
  const camera = await import(file);
  for (let k = 0; k < count; k++, at += 8) {{
    const one = given.subarray(at, at + 8);
    out.push(...(camera.projectRay([...one.subarray(0, 3)]) ?? none.slice(1)));
    out.push(...(camera.project([...one.subarray(3, 6)]) ?? none.slice(1)));
    out.push(...(camera.unproject([...one.subarray(6)]) ?? none));
  }}
}}
const all = new Uint8Array(Float64Array.from(out).buffer);
for (let done = 0; done < all.length;) done += writeSync(1, all, done);
"""
_PYTHON = """
import importlib.util, sys
import numpy as np
sys.modules["cubicfish"] = None  # as if it were not installed
given = np.frombuffer(sys.stdin.buffer.read()).reshape({cameras}, {count}, 8)
for file, own in zip({files}, given):
    spec = importlib.util.spec_from_file_location("camera", file)
    camera = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(camera)
    answers = [camera.project_ray(own[:, :3]), camera.project(own[:, 3:6]),
               camera.unproject(own[:, 6:])]
    sys.stdout.buffer.write(np.hstack(answers).tobytes())
"""
# Each camera draws a picture, a third each of rays, points and pixels, a hundred in a row. What is
# read of it comes back in the page's text.
_WEB = """<!DOCTYPE html><pre id="out"></pre><script>
const decode = (text) => Float32Array.from(
  new Float64Array(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer));
const given = decode("{given}"), sources = {sources}, count = {count}, out = [];
const rows = count / 100; // of texels, for each kind of question
const gl = document.createElement("canvas").getContext("webgl2");
if (!gl || !gl.getExtension("EXT_color_buffer_float")) throw new Error("no WebGL2");
function shader(kind, text) {{
  const made = gl.createShader(kind);
  gl.shaderSource(made, text);
  gl.compileShader(made);
  if (!gl.getShaderParameter(made, gl.COMPILE_STATUS)) throw new Error(gl.getShaderInfoLog(made));
  return made;
}}
function texture(data) {{
  gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
  gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA32F, 100, 3 * rows, 0, gl.RGBA, gl.FLOAT, data);
  for (const which of [gl.TEXTURE_MIN_FILTER, gl.TEXTURE_MAG_FILTER])
    gl.texParameteri(gl.TEXTURE_2D, which, gl.NEAREST);
}}
try {{
  sources.forEach(([name, source], number) => {{
    const own = new Float32Array(12 * count);
    for (let k = 0; k < count; k++) for (let j = 0; j < 8; j++)
      own[4 * (k + count * Math.floor(j / 3)) + (j % 3)] = given[8 * (k + count * number) + j];
    const program = gl.createProgram();
    gl.attachShader(program, shader(gl.VERTEX_SHADER, `#version 300 es
      void main() {{
        gl_Position = vec4(vec2(gl_VertexID % 2, gl_VertexID / 2) * 4.0 - 1.0, 0, 1);
      }}`));
    gl.attachShader(program, shader(gl.FRAGMENT_SHADER, `#version 300 es
      precision highp float;
      ` + source + `
      uniform sampler2D given;
      out vec4 answer;
      void main() {{
        ivec2 at = ivec2(gl_FragCoord.xy);
        vec3 one = texelFetch(given, at, 0).xyz, ray;
        vec2 pixel;
        bool known;
        if (at.y < 2 * ${{rows}}) {{
          known = at.y < ${{rows}}
            ? ${{name}}_project_ray(one, pixel) : ${{name}}_project(one, pixel);
          ray = vec3(pixel, 0.0);
        }} else known = ${{name}}_unproject(one.xy, ray);
        answer = vec4(ray, known ? 1.0 : 0.0);
      }}`));
    gl.linkProgram(program);
    gl.useProgram(program);
    texture(own);
    const read = gl.getParameter(gl.TEXTURE_BINDING_2D);
    texture(null);
    const drawn = gl.getParameter(gl.TEXTURE_BINDING_2D);
    gl.bindFramebuffer(gl.FRAMEBUFFER, gl.createFramebuffer());
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, drawn, 0);
    gl.viewport(0, 0, 100, 3 * rows);
    gl.bindTexture(gl.TEXTURE_2D, read);
    gl.drawArrays(gl.TRIANGLES, 0, 3);
    const answers = new Float32Array(12 * count);
    gl.readPixels(0, 0, 100, 3 * rows, gl.RGBA, gl.FLOAT, answers);
    out.push(answers);
  }});
  const all = new Uint8Array(out.reduce((sum, one) => sum + one.byteLength, 0));
  out.forEach((one, k) => all.set(new Uint8Array(one.buffer), k * one.byteLength));
  let text = "";
  for (const one of all) text += String.fromCharCode(one);
  document.getElementById("out").textContent = "=" + btoa(text) + "=";
}} catch (problem) {{
  document.getElementById("out").textContent = problem;
}}
</script>"""


def _run(*words: object, given: bytes = b"") -> bytes:
    done = subprocess.run([str(word) for word in words], input=given, capture_output=True)
    assert done.returncode == 0, (done.stderr or done.stdout).decode()[-3000:]
    return done.stdout


def _ask_c(compiler: str) -> Callable[[Path, Mapping[str, Path], FloatArray], FloatArray]:
    def ask(folder: Path, files: Mapping[str, Path], given: FloatArray) -> FloatArray:
        is_c = not compiler.endswith("++")
        source, program = folder / ("ask.c" if is_c else "ask.cpp"), folder / "ask"
        includes = "\n".join(f'#include "{file.name}"' for file in files.values())
        answers = "\n  ".join(f"ANSWER({name})" for name in files)
        source.write_text(_C.format(includes=includes, answers=answers, count=len(given[0])))
        standard = "-std=c99" if is_c else "-std=c++11"
        strict = ("-Wall", "-Wextra", "-Wpedantic", "-Werror")
        _run(compiler, standard, *strict, "-O1", source, "-o", program, "-lm")
        return np.frombuffer(_run(program, given=given.tobytes())).reshape(*given.shape[:2], 13)

    return ask


def _ask_script(
    program: str, text: str
) -> Callable[[Path, Mapping[str, Path], FloatArray], FloatArray]:
    def ask(folder: Path, files: Mapping[str, Path], given: FloatArray) -> FloatArray:
        script = folder / ("ask.mjs" if program == "node" else "ask.py")
        names = [str(file) for file in files.values()]
        script.write_text(text.format(files=names, count=len(given[0]), cameras=len(given)))
        said = _run(program, script, given=given.tobytes())
        return np.frombuffer(said).reshape(*given.shape[:2], 7)

    return ask


def _ask_shader(folder: Path, files: Mapping[str, Path], given: FloatArray) -> FloatArray:
    page, count = folder / "ask.html", len(given[0])
    sources = str([[name, file.read_text()] for name, file in files.items()])
    text = base64.b64encode(given.tobytes()).decode()
    page.write_text(_WEB.format(given=text, sources=sources, count=count))
    said = _run(
        "chromium", "--headless", "--no-sandbox", "--use-angle=swiftshader",
        "--enable-unsafe-swiftshader", f"--user-data-dir={folder / 'profile'}", "--dump-dom",
        page.as_uri(),
    ).decode()  # fmt: skip
    found = re.search(r'<pre id="out">(?:=([\w+/=]*)=|(.*))</pre>', said, re.DOTALL)
    assert found is not None, said[-3000:]
    assert found[1] is not None, found[2]
    read = np.frombuffer(base64.b64decode(found[1]), np.float32).astype(float)
    rows = read.reshape(len(files), 3, count, 4)
    seen = np.where(rows[..., 3:] > 0, rows[..., :3], np.nan)
    return np.concatenate([seen[:, 0, :, :2], seen[:, 1, :, :2], seen[:, 2]], axis=-1)


@dataclass(frozen=True, kw_only=True)
class Language:
    """A way to run what ``export`` writes.

    Attributes:
        program: what compiles or runs it.
        to: the format.
        suffix: of its files.
        ask: (folder, files by names, questions (cameras, N, 8)) -> answers (cameras, N, 7), or 13
            with slopes after the first four.
        near_px, near_rad: how near its answers must be.

    """

    program: str
    to: str
    suffix: str
    ask: Callable[[Path, Mapping[str, Path], FloatArray], FloatArray]
    near_px: float = 1e-9
    near_rad: float = 1e-9


LANGUAGES = {
    **{
        name: Language(program=name, to="c", suffix="h", ask=_ask_c(name))
        for name in ("gcc", "clang", "g++", "clang++")
    },
    "python": Language(
        program=sys.executable,
        to="python",
        suffix="py",
        ask=_ask_script(sys.executable, _PYTHON),
        near_px=1e-12,
    ),
    "node": Language(program="node", to="js", suffix="mjs", ask=_ask_script("node", _JS)),
    "chromium": Language(
        program="chromium",
        to="glsl",
        suffix="glsl",
        ask=_ask_shader,
        near_px=2e-3,
        near_rad=1e-5,
    ),
}


def ask(
    language: str, cameras: Mapping[str, CameraFile], asked: Mapping[str, Questions], folder: Path
) -> dict[str, Answers]:
    """Ask all cameras in one process, by their names."""
    own, files = LANGUAGES[language], {}
    for name, camera in cameras.items():
        files[name] = folder / f"{name}.{own.suffix}"
        files[name].write_text(source_text(camera, own.to, name))
    given = [np.hstack([asked[name].rays, asked[name].points, asked[name].pixel]) for name in files]
    found = own.ask(folder, files, np.array(given))
    return {
        name: Answers(
            of_rays=one[:, :2],
            of_points=one[:, 2:4],
            of_pixel=one[:, -3:],
            slopes=one[:, 4:10].reshape(-1, 2, 3) if one.shape[1] == 13 else None,
        )
        for name, one in zip(files, found, strict=True)
    }
