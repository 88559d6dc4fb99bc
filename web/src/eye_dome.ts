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

const FRAGMENT = `
uniform sampler2D image, depths;
uniform vec2 pixel;
uniform float near, far, strength;
uniform vec3 background;
varying vec2 place;
float logDepth(vec2 at) {
  float depth = texture2D(depths, at).r;
  float ndc = 2.0 * depth - 1.0;
  return log2(2.0 * near * far / (far + near - ndc * (far - near)));
}
void main() {
  if (texture2D(depths, place).r >= 1.0) { gl_FragColor = vec4(background, 1.0); return; }
  float here = logDepth(place), sum = 0.0;
  for (int i = 0; i < 8; i++) {
    float angle = float(i) * 0.78539816;
    vec2 at = place + pixel * 1.6 * vec2(cos(angle), sin(angle));
    sum += min(max(0.0, here - logDepth(at)), 0.02);
  }
  vec3 color = texture2D(image, place).rgb;
  gl_FragColor = vec4(color * exp(-sum * 12.5 * strength), 1.0);
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

  render(scene: Scene, camera: PerspectiveCamera, background: Color): void {
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
  }

  dispose(): void {
    this.target.depthTexture?.dispose();
    this.target.dispose();
    this.material.dispose();
  }
}
