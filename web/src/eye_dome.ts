// Eye-dome lighting: points darker where their neighbours on the screen are nearer, which shows shape
// without normals (Boucheny 2009).
import {
  BufferGeometry, DepthTexture, Float32BufferAttribute, Mesh, OrthographicCamera, PerspectiveCamera, Scene,
  ShaderMaterial, UnsignedIntType, Vector2, Vector3, WebGLRenderer, WebGLRenderTarget, type Color,
} from "three";

const STRENGTH = 1.1;

const VERTEX = `
varying vec2 place;
void main() { place = uv; gl_Position = vec4(position.xy, 0.0, 1.0); }`;

// the reciprocal of the distance from the camera is linear in the depth buffer
const FRAGMENT = `
uniform sampler2D image, depths;
uniform vec2 pixel;
uniform float near, far, strength;
uniform vec3 background;
varying vec2 place;
float nearer(float here, vec2 way) {
  float there = far - texture2D(depths, place + pixel * way).r * (far - near);
  return clamp(there / here - 1.0, 0.0, 0.014);
}
void main() {
  float depth = texture2D(depths, place).r;
  if (depth >= 1.0) { gl_FragColor = vec4(background, 1.0); return; }
  float here = far - depth * (far - near);
  float sum = nearer(here, vec2(1.6, 0.0)) + nearer(here, vec2(-1.6, 0.0))
    + nearer(here, vec2(0.0, 1.6)) + nearer(here, vec2(0.0, -1.6))
    + nearer(here, vec2(1.1, 1.1)) + nearer(here, vec2(-1.1, 1.1))
    + nearer(here, vec2(1.1, -1.1)) + nearer(here, vec2(-1.1, -1.1));
  gl_FragColor = vec4(texture2D(image, place).rgb * exp(-sum * 18.0 * strength), 1.0);
}`;

/** Draws a scene to the screen with eye-dome lighting. */
export class EyeDome {
  private readonly target: WebGLRenderTarget;
  private readonly material: ShaderMaterial;
  private readonly scene = new Scene();
  private readonly camera = new OrthographicCamera();

  constructor(private readonly renderer: WebGLRenderer) {
    this.target = new WebGLRenderTarget(1, 1, { depthTexture: new DepthTexture(1, 1, UnsignedIntType) });
    this.material = new ShaderMaterial({
      vertexShader: VERTEX,
      fragmentShader: FRAGMENT,
      depthTest: false,
      depthWrite: false,
      uniforms: {
        image: { value: this.target.texture },
        depths: { value: this.target.depthTexture },
        pixel: { value: new Vector2() },
        near: { value: 0 },
        far: { value: 0 },
        strength: { value: STRENGTH },
        background: { value: new Vector3() },
      },
    });
    const triangle = new BufferGeometry();
    triangle.setAttribute("position", new Float32BufferAttribute([-1, -1, 0, 3, -1, 0, -1, 3, 0], 3));
    triangle.setAttribute("uv", new Float32BufferAttribute([0, 0, 2, 0, 0, 2], 2));
    const mesh = new Mesh(triangle, this.material);
    mesh.frustumCulled = false;
    this.scene.add(mesh);
  }

  setSize(width: number, height: number): void {
    this.target.setSize(width, height);
    this.material.uniforms.pixel!.value.set(1 / width, 1 / height);
  }

  /** Draw the scene, and marks over it. */
  render(scene: Scene, marks: Scene, camera: PerspectiveCamera, background: Color): void {
    const { uniforms } = this.material;
    uniforms.near!.value = camera.near;
    uniforms.far!.value = camera.far;
    uniforms.background!.value.set(background.r, background.g, background.b);
    this.renderer.setRenderTarget(this.target);
    this.renderer.setClearColor(background, 1);
    this.renderer.clear();
    this.renderer.render(scene, camera);
    this.renderer.setRenderTarget(null);
    this.renderer.render(this.scene, this.camera);
    this.renderer.clearDepth();
    this.renderer.render(marks, camera);
  }

  dispose(): void {
    this.target.depthTexture?.dispose();
    this.target.dispose();
    this.material.dispose();
  }
}
